// Plan, elevations and the section box, for surveyors and show rooms.
import {
  elevation_eye,
  elevation_of,
  elevations,
  extent_along,
  room_before,
  type Elevation,
} from '../camera/elevation';
import { add, dot, forward, rotate, scale, sub } from '../base/vector';
import type { Eye } from '../camera/eye';
import { OrthographicController } from '../camera/orthographic_controller';
import { box_around, box_of, section_of_box, type UprightBox } from '../camera/upright_box';
import { kept_system, type Scale } from '../measure/units';
import { by_id, make } from '../page/dom';
import type { PageParts } from '../page/parts';
import { number } from '../text/number';
import { text } from '../text/text';
import type { MeasureList } from '../tour/measure_list';
import { ScaleBar } from './scale_bar';
import { SectionBox } from './section_box';
import './views.css';

interface ViewsParts extends PageParts {
  /** They know the scale of the scene. */
  readonly measures: MeasureList;
}

const half_without_content = 3; // half the side of the box where the content is not known, in the scene's scales
const degrees = 180 / Math.PI;

export class ViewsPanel {
  private readonly panel_ = by_id('views-panel', HTMLElement);
  private readonly buttons_ = new Map<Elevation | 'perspective', HTMLButtonElement>();
  private readonly section_ = make('input', { type: 'checkbox' });
  private readonly turn_ = make('input', {
    id: 'views-turn',
    type: 'range',
    min: '-180',
    max: '180',
    step: '1',
  });
  private readonly turned_ = make('output');
  private readonly reset_ = make('button', { type: 'button' }, text.views.reset);
  private readonly bar_: ScaleBar;
  private readonly box_: SectionBox;
  private eye_: Eye;
  private turn_rad_ = 0; // where there is no section
  private edits_: boolean; // the visitor has opened the panel, and sees the box

  constructor(private readonly parts_: ViewsParts) {
    const { view, navigation, clipping, seen, toolbar, measures } = parts_;
    this.eye_ = navigation.eye;
    const scale = (): Scale => this.scale;
    this.bar_ = new ScaleBar(view, scale);
    this.box_ = new SectionBox(parts_, scale, by_id('hotspots', HTMLElement));
    this.panel_.append(this.view_buttons(), this.section_fields());
    this.edits_ = !this.panel_.hidden;
    seen.moved.listen((eye) => this.draw(eye));
    clipping.changed.listen(() => this.section_changed());
    measures.changed.listen(() => this.draw(this.eye_));
    toolbar.panel_shown.listen(({ panel, shown }) => {
      if (panel === 'views' && shown) this.edits_ = true;
      if (panel === 'views' || panel === 'measure') this.draw(this.eye_);
    });
    navigation.entered.listen(() => {
      this.edits_ = !this.panel_.hidden;
      this.turn_rad_ = 0;
      this.show_fields();
    });
    navigation.camera.load_orthographic((rig) => new OrthographicController(rig));
    window.addEventListener('resize', () => this.draw(this.eye_));
    this.show_fields();
    this.draw(this.eye_);
  }

  private get section(): UprightBox | undefined {
    const { section } = this.parts_.clipping;
    return section && box_of(section);
  }

  private get scale(): Scale {
    const { measures, storage } = this.parts_;
    return { metres_per_unit: measures.metres_per_unit, system: kept_system(storage) };
  }

  private get near_z(): number {
    return this.parts_.navigation.camera.scene?.near_z ?? 0;
  }

  private view_buttons(): HTMLElement {
    const made = (['perspective', ...elevations] as const).map((name) => {
      const button = make('button', { type: 'button' }, text.views[name]);
      button.addEventListener('click', () => this.choose(name));
      this.buttons_.set(name, button);
      return button;
    });
    return make('fieldset', {}, make('legend', {}, text.views.view), ...made);
  }

  private section_fields(): HTMLElement {
    const { clipping } = this.parts_;
    this.section_.addEventListener('change', () => {
      clipping.edit(this.section_.checked ? section_of_box(this.whole()) : undefined);
    });
    this.reset_.addEventListener('click', () => {
      this.turn_to(0);
      clipping.edit(section_of_box(this.whole()));
    });
    this.turn_.addEventListener('input', () => this.turn_to(Number(this.turn_.value) / degrees));
    return make(
      'fieldset',
      {},
      make('label', {}, this.section_, make('span', {}, text.views.section)),
      make('label', { htmlFor: this.turn_.id }, text.views.turn, ' ', this.turned_),
      this.turn_,
      make('p', {}, text.views.hint),
      this.reset_,
    );
  }

  /** The box that a section begins with, and that elevations show without one. */
  private whole(): UprightBox {
    const { camera } = this.parts_.navigation;
    const { content, focus } = camera.scene ?? no_scene;
    const half = scale([1, 1, 1], half_without_content * camera.reach);
    const { min, max } = content ?? { min: sub(focus, half), max: add(focus, half) };
    return box_around({ min, max }, camera.up, this.turn_rad_, camera.reach);
  }

  private choose(name: Elevation | 'perspective'): void {
    const { navigation, view } = this.parts_;
    if (name === 'perspective') return navigation.leave_orthographic();
    const { up, fov_y_rad } = navigation.camera;
    const aspect = view.clientWidth / Math.max(1, view.clientHeight);
    const box = this.section ?? this.whole();
    navigation.taken_over.emit();
    navigation.put(elevation_eye(name, box, up, aspect, fov_y_rad, this.near_z));
  }

  /** The elevation that is shown turns along. */
  private turn_to(turn_rad: number): void {
    const { navigation, clipping } = this.parts_;
    const shown = this.elevation();
    this.turn_rad_ = turn_rad;
    if (this.section) clipping.edit(section_of_box({ ...this.section, turn_rad }));
    if (shown) this.choose(shown);
    else this.draw(navigation.eye);
    this.show_fields();
  }

  private elevation(): Elevation | undefined {
    const { navigation } = this.parts_;
    return elevation_of(navigation.eye, this.turn_rad_, navigation.camera.up);
  }

  private section_changed(): void {
    const { section } = this;
    if (section) this.turn_rad_ = section.turn_rad;
    this.stay_outside();
    this.show_fields();
    this.draw(this.eye_);
  }

  /** An orthographic camera moves back along its axis where the box has come too near: its picture stays. A flight goes on. */
  private stay_outside(): void {
    const { section } = this;
    const { navigation } = this.parts_;
    const { eye, camera } = navigation;
    if (!section || eye.view_height === undefined || camera.is_flying) return;
    const view = rotate(eye.orientation, forward);
    const extent = extent_along(section, camera.up, view);
    const before = dot(sub(section.centre, eye.position), view) - extent / 2;
    const room = room_before(extent, this.near_z);
    if (before >= room / 2) return;
    navigation.put({ ...eye, position: add(eye.position, scale(view, before - room)) });
  }

  private show_fields(): void {
    const { section } = this;
    this.section_.checked = section !== undefined;
    this.reset_.disabled = !section;
    const turn_deg = Math.round(this.turn_rad_ * degrees);
    const words = number(turn_deg, { style: 'unit', unit: 'degree', unitDisplay: 'narrow' });
    this.turn_.value = String(turn_deg);
    this.turn_.setAttribute('aria-valuetext', words);
    this.turned_.textContent = words;
  }

  private draw(eye: Eye): void {
    this.eye_ = eye;
    this.bar_.draw(eye);
    this.box_.draw(this.edits_ ? this.section : undefined, eye);
    const shown = this.elevation() ?? (eye.view_height === undefined ? 'perspective' : undefined);
    for (const [name, button] of this.buttons_)
      button.setAttribute('aria-pressed', String(name === shown));
  }
}

const no_scene = { content: undefined, focus: [0, 0, 0] } as const;
