// A small panel before the visitor: the page's own card and tour, and how to leave.
import { add, dot, length, scale, sub, type Vec3 } from '../base/vector';
import type { Pose } from '../camera/eye';
import { by_id } from '../page/dom';
import { text } from '../text/text';
import { font, Sign, type Overlay, type Plate } from './overlay';
import type { Target } from './pointers';
import { facing, level_ahead, met_plate, type RoomRay } from './plate';

interface Button {
  readonly label: string;
  /** Drawn instead of the label: the name of an icon of the page. */
  readonly icon?: string;
  readonly is_on: boolean;
  press(): void;
}

/** What it shows. */
interface Content {
  readonly title: string;
  readonly words: string;
  readonly rows: readonly (readonly Button[])[];
  /** The visitor has to see it. */
  readonly is_urgent: boolean;
}

interface Placed {
  readonly button: Button;
  readonly x: number;
  readonly y: number;
  readonly width: number;
}

interface PanelActions {
  leave(): void;
  darkens(): boolean;
  set_darkens(on: boolean): void;
}

const width_px = 640;
const pad_px = 24;
const line_px = 32;
const button_px = 68;
const most_lines = 8;
const width_m = 0.6;
const away_m = 0.85;
const below_m = 0.55; // of the eyes
const turned_cosine = Math.cos((50 * Math.PI) / 180); // a head that turns farther takes it along
const walked_m = 0.5;
const look_ms = 200;

const is_shown = (id: string): boolean => !by_id(id, HTMLElement).hidden;
const said = (id: string): string => by_id(id, HTMLElement).innerText.trim();

/** A button of the page, with the words or the icon that it has now; none where the page does not offer it. */
function page_button(id: string): Button[] {
  const button = by_id(id, HTMLButtonElement);
  if (button.hidden || button.disabled) return [];
  const words = said(id);
  const icon = button.querySelector('use')?.getAttribute('href')?.replace('#icon-', '');
  return [
    {
      label: words || (icon ?? id),
      ...(!words && icon && { icon }),
      is_on: button.getAttribute('aria-pressed') === 'true',
      press: () => button.click(),
    },
  ];
}

function content_of(actions: PanelActions): Content {
  const has_tour = is_shown('tour');
  const is_urgent = is_shown('card');
  const note = is_shown('notice') ? said('notice-text') : '';
  const tour = ['tour-previous', 'tour-play', 'tour-next', 'tour-portal'];
  const closed = is_shown('tour-closed') ? said('tour-closed') : '';
  const darken = {
    label: text.headset.darken,
    is_on: actions.darkens(),
    press: () => actions.set_darkens(!actions.darkens()),
  };
  const leave = { label: text.headset.leave, is_on: false, press: () => actions.leave() };
  return {
    title: is_urgent ? said('card-title') : has_tour ? said('tour-title') : '',
    words: is_urgent
      ? said('card-text')
      : [note, has_tour ? said('tour-text') : '', closed].filter((s) => s !== '').join('\n'),
    rows: [
      is_urgent ? page_button('card-action') : [],
      has_tour ? tour.flatMap(page_button) : [],
      [...page_button('button-mode'), ...page_button('button-sound'), darken],
      [leave],
    ].filter((row) => row.length > 0),
    is_urgent,
  };
}

/** Breaks words into lines, at most so many. */
function lines_of(context: CanvasRenderingContext2D, words: string): string[] {
  const lines: string[] = [];
  for (const paragraph of words.split('\n')) {
    let line = '';
    // Chinese and Japanese have no spaces: any of their letters may end a line.
    for (const word of paragraph.match(/[\u3000-\u9fff\uff00-\uffef]|[^\s\u3000-\u9fff]+\s*/g) ??
      []) {
      if (line && context.measureText(line + word).width > width_px - 2 * pad_px) {
        lines.push(line);
        line = '';
      }
      line += word;
    }
    if (line) lines.push(line);
  }
  return lines.length > most_lines
    ? [...lines.slice(0, most_lines - 1), `${lines[most_lines - 1]!.trim()}…`]
    : lines;
}

const title_font = (): string => font(28, 600);
const text_font = (): string => font(22);

export class Panel {
  private readonly sign_: Sign;
  private readonly measure_ = document.createElement('canvas').getContext('2d');
  private buttons_: readonly Placed[] = [];
  private plate_: Plate | undefined;
  private anchor_: { readonly at: Vec3; readonly ahead: Vec3 } | undefined;
  private is_urgent_ = false;
  private looked_ms_ = -Infinity;
  private pointed_: Button | undefined;
  private outlined_: string | undefined; // as it is painted
  private content_: Content | undefined;

  constructor(
    gl: WebGL2RenderingContext,
    private readonly actions_: PanelActions,
  ) {
    this.sign_ = new Sign(gl, width_px);
  }

  /** The button that a ray meets. It is drawn so until the next call. */
  pointed(ray: RoomRay): Target | undefined {
    const at = this.plate_ && met_plate(ray, this.plate_);
    if (!at) return undefined;
    const [x, y] = [at.x * width_px, at.y * this.sign_.height_px];
    const found = this.buttons_.find(
      (b) => x >= b.x && x <= b.x + b.width && y >= b.y && y <= b.y + button_px,
    );
    this.pointed_ = found?.button;
    const press = (): void => {
      found?.button.press();
      this.looked_ms_ = -Infinity;
    };
    return { id: `panel ${found?.button.label ?? ''}`, press, distance: at.distance };
  }

  draw(overlay: Overlay, head: Pose, now_ms: number): void {
    const looks = now_ms - this.looked_ms_ > look_ms;
    if (looks) {
      this.looked_ms_ = now_ms;
      this.content_ = content_of(this.actions_);
    }
    const pointed = this.pointed_?.label;
    if (this.content_ && (looks || pointed !== this.outlined_)) {
      this.outlined_ = pointed;
      this.paint(this.content_);
    }
    this.pointed_ = undefined;
    this.place(head);
    if (this.plate_) overlay.sign(this.sign_, this.plate_);
  }

  private place({ position, orientation }: Pose): void {
    const ahead = level_ahead(orientation);
    const { anchor_: anchor } = this;
    if (
      !anchor ||
      dot(ahead, anchor.ahead) < turned_cosine ||
      length(sub(position, anchor.at)) > walked_m
    )
      this.anchor_ = { at: position, ahead };
    const { at, ahead: towards } = this.anchor_ ?? { at: position, ahead };
    const lower: Vec3 = [0, this.is_urgent_ ? 0.05 : below_m, 0];
    const middle = add(add(at, scale(towards, away_m)), lower);
    const half_height = ((width_m / 2) * this.sign_.height_px) / width_px;
    this.plate_ = facing(middle, at, width_m / 2, half_height);
  }

  private paint({ title, words, rows, is_urgent }: Content): void {
    const { measure_: measure } = this;
    if (!measure) return;
    this.is_urgent_ = is_urgent;
    measure.font = text_font();
    const lines = lines_of(measure, words);
    const title_px = title ? 44 : 0;
    const first_row = pad_px + title_px + lines.length * line_px + (title || words ? 12 : 0);
    this.buttons_ = rows.flatMap((row, r) => {
      // Each has the room that its label needs, in proportion.
      const wanted = row.map(({ label }) => measure.measureText(label).width + 40);
      const room = width_px - 2 * pad_px - (row.length - 1) * 12;
      const share = room / wanted.reduce((sum, width) => sum + width, 0);
      let x = pad_px;
      return row.map((button, i) => {
        const placed = {
          button,
          x,
          y: first_row + r * (button_px + 12),
          width: wanted[i]! * share,
        };
        x += placed.width + 12;
        return placed;
      });
    });
    const height = first_row + rows.length * (button_px + 12) - 12 + pad_px;
    const pointed = this.pointed_?.label;
    const what = JSON.stringify([title, lines, rows, pointed]);
    this.sign_.show(what, height, (context) => {
      context.fillStyle = 'rgba(16, 18, 24, 0.92)';
      context.beginPath();
      context.roundRect(0, 0, width_px, height, 24);
      context.fill();
      const { direction } = getComputedStyle(document.documentElement);
      context.direction = direction === 'rtl' ? 'rtl' : 'ltr';
      context.textBaseline = 'middle';
      context.fillStyle = '#fff';
      const begin = direction === 'rtl' ? width_px - pad_px : pad_px;
      context.font = title_font();
      context.fillText(title, begin, pad_px + 18, width_px - 2 * pad_px);
      context.font = text_font();
      lines.forEach((line, i) =>
        context.fillText(line, begin, pad_px + title_px + (i + 0.5) * line_px),
      );
      this.paint_buttons(context, pointed);
    });
  }

  private paint_buttons(context: CanvasRenderingContext2D, pointed: string | undefined): void {
    context.textAlign = 'center';
    for (const { button, x, y, width } of this.buttons_) {
      context.fillStyle = button.is_on ? '#2f6fde' : '#333a48';
      context.beginPath();
      context.roundRect(x, y, width, button_px, 14);
      context.fill();
      context.lineWidth = 4;
      context.strokeStyle = button.label === pointed ? '#fff' : 'transparent';
      context.stroke();
      context.fillStyle = '#fff';
      const middle = [x + width / 2, y + button_px / 2] as const;
      if (button.icon) paint_icon(context, button.icon, ...middle);
      else context.fillText(button.label, ...middle, width - 16);
    }
  }
}

const icon_side = 24; // of the drawings in index.html
const icon_scale = 1.6;

function paint_icon(context: CanvasRenderingContext2D, name: string, x: number, y: number): void {
  context.save();
  context.translate(x - (icon_side / 2) * icon_scale, y - (icon_side / 2) * icon_scale);
  context.scale(icon_scale, icon_scale);
  context.lineWidth = 2;
  context.strokeStyle = '#fff';
  for (const path of document.querySelectorAll(`#icon-${name} path`))
    context.stroke(new Path2D(path.getAttribute('d') ?? ''));
  context.restore();
}
