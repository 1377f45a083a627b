// Pictures and films for authors. It loads when an author opens it.
import type { Eye } from '../camera/eye';
import { clip_box } from '../camera/upright_box';
import {
  cancel_film,
  film_address,
  film_endings,
  film_state,
  order_film,
  type FilmRequest,
} from '../film/jobs';
import {
  film_eyes,
  film_fps,
  film_length_s,
  most_film_frames,
  write_tum,
  write_views,
} from '../film/path';
import { make, save_file } from '../page/dom';
import type { PageParts } from '../page/parts';
import { file_name_of } from '../session/scenes';
import { duration, number } from '../text/number';
import { text } from '../text/text';
import type { Tour } from '../tour/tour';

export interface FilmTools extends Pick<PageParts, 'navigation' | 'clipping'> {
  /** The tour that is edited. */
  tour(): Tour;
  /** Lets its holder order; undefined: this visitor may not. */
  token(): string | undefined;
}

type Kind = FilmRequest['kind'];

const { film: words } = text;
const sizes: Readonly<Record<Kind, readonly (readonly [number, number])[]>> = {
  picture: [
    [1920, 1080],
    [3840, 2160],
    [7680, 4320],
  ],
  panorama: [
    [4096, 2048],
    [8192, 4096],
  ],
  film: [
    [1280, 720],
    [1920, 1080],
  ],
};
const look_again_ms = 500;
const most_wait_ms = 15_000; // where no server answers

export class FilmPanel {
  private readonly kind_ = make('select', {});
  private readonly size_ = make('select', {});
  private readonly make_ = make('button', { type: 'button', className: 'primary' }, words.make);
  private readonly path_ = make('button', { type: 'button' }, words.path);
  private readonly cancel_ = make('button', { type: 'button', hidden: true }, words.cancel);
  private readonly bar_ = make('progress', { max: 1, hidden: true, 'aria-label': words.title });
  private readonly save_ = make('a', { hidden: true }, words.save);
  private readonly said_ = make('output', { 'aria-live': 'polite' });
  private readonly left_ = make('p', { hidden: true }); // changes all the time, so it is not read out
  private job_: string | undefined;

  constructor(
    host: HTMLElement,
    private readonly tools_: FilmTools,
  ) {
    this.kind_.append(
      ...(['picture', 'panorama', 'film'] as const).map((kind) => new Option(words[kind], kind)),
    );
    this.kind_.addEventListener('change', () => this.choose());
    this.make_.addEventListener('click', () => void this.order());
    this.path_.addEventListener('click', () => this.save_path());
    this.cancel_.addEventListener('click', () => {
      if (this.job_) void cancel_film(location.href, this.job_);
    });
    const row = make('div', {}, this.make_, this.path_, this.cancel_);
    row.classList.add('row');
    host.append(
      make('label', {}, make('span', {}, words.kind), this.kind_),
      make('label', {}, make('span', {}, words.size), this.size_),
      row,
      ...[this.bar_, this.left_, this.said_, this.save_],
    );
    this.choose();
  }

  private get kind(): Kind {
    return this.kind_.value as Kind;
  }

  private choose(): void {
    const { kind } = this;
    this.size_.replaceChildren(
      ...sizes[kind].map(([x, y], i) => new Option(`${x} × ${y}`, String(i))),
    );
    this.path_.hidden = kind !== 'film';
    this.say('');
    this.look();
  }

  /** The token, or what it lets its holder do, may have changed. */
  look(): void {
    const may_order = this.tools_.token() !== undefined;
    this.make_.hidden = !may_order;
    if (!may_order) this.say(words.not_author);
    else if (this.said_.textContent === words.not_author) this.say('');
  }

  private say(what: string): void {
    this.said_.textContent = what;
    this.said_.scrollIntoView({ block: 'nearest' }); // an empty output is not displayed: nothing scrolls
  }

  /** The frames of the film; undefined, and the panel says why: there is none. */
  private eyes(): readonly Eye[] | undefined {
    if (this.kind !== 'film') return [this.tools_.navigation.eye];
    const tour = this.tools_.tour();
    const length_s = film_length_s(tour, this.tools_.navigation.reach);
    const most_s = most_film_frames / film_fps;
    if (length_s === 0) this.say(words.no_stops);
    else if (length_s > most_s)
      this.say(words.too_long({ most: duration(most_s), length: duration(length_s) }));
    else return film_eyes(tour, this.tools_.navigation.reach);
    return undefined;
  }

  /** The visitor's section box. */
  private box(): number[] | undefined {
    const { clipping, navigation } = this.tools_;
    if (!clipping.section) return undefined;
    const { world_from_box, half_extent } = clip_box(
      clipping.section,
      navigation.camera.up,
      undefined,
    );
    return [...world_from_box.position, ...world_from_box.orientation, ...half_extent];
  }

  private save_path(): void {
    const eyes = this.eyes();
    if (!eyes) return;
    const file = `${file_name_of(this.tools_.navigation.scene_id)}.tum`;
    save_file(new Blob([write_tum(eyes)], { type: 'text/plain' }), file);
    const { fov_y_rad, view_height } = eyes[0] ?? { fov_y_rad: 1 };
    const command = [
      'catgs-render',
      'frames',
      '…',
      '--trace',
      file,
      ...(view_height
        ? ['--orthographic', view_height.toPrecision(6)]
        : ['--fov-deg', ((fov_y_rad * 180) / Math.PI).toFixed(1)]),
      '--out',
      'film.mp4',
    ];
    this.say(words.path_saved({ command: command.join(' ') }));
  }

  private async order(): Promise<void> {
    const eyes = this.eyes();
    const token = this.tools_.token();
    if (!eyes || token === undefined) return;
    const { kind } = this;
    const size = sizes[kind][Number(this.size_.value)]!;
    const name = file_name_of(this.tools_.navigation.scene_id) + film_endings[kind];
    this.save_.hidden = true;
    this.say('');
    this.make_.disabled = true;
    const ordered = await order_film(location.href, token, this.tools_.navigation.scene_id, {
      kind,
      size,
      views: write_views(eyes),
      box: kind === 'film' ? undefined : this.box(),
    });
    if ('id' in ordered) await this.watch(ordered.id, name);
    else this.say(words.failed({ why: ordered.why || text.author.unreachable }));
    this.make_.disabled = false;
  }

  /** Shows how far the job is, until it ends. */
  private async watch(id: string, name: string): Promise<void> {
    this.job_ = id;
    this.cancel_.hidden = this.bar_.hidden = this.left_.hidden = false;
    this.bar_.scrollIntoView({ block: 'nearest' });
    for (let wait_ms = look_again_ms; ; ) {
      const now = await film_state(location.href, id);
      if (now) this.show(now.state, now.share, now.seconds_left);
      if (now?.state === 'failed') this.say(words.failed({ why: now.error ?? '' }));
      if (now?.state === 'cancelled') this.say(words.cancelled);
      if (now?.state === 'done') {
        Object.assign(this.save_, {
          href: film_address(location.href, id),
          download: name,
          hidden: false,
        });
        this.say(words.done);
      }
      if (now && now.state !== 'waiting' && now.state !== 'drawing') break;
      wait_ms = now ? look_again_ms : Math.min(2 * wait_ms, most_wait_ms);
      await new Promise((resolve) => setTimeout(resolve, wait_ms));
    }
    this.cancel_.hidden = this.bar_.hidden = this.left_.hidden = true;
    this.job_ = undefined;
  }

  private show(state: string, share: number, seconds_left: number | undefined): void {
    this.bar_.value = share;
    this.left_.textContent =
      state === 'waiting'
        ? words.waiting
        : seconds_left === undefined
          ? words.drawing
          : words.drawn({
              share: number(share, { style: 'percent' }),
              time: duration(seconds_left),
            });
  }
}
