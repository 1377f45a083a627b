// Asks the author of a scene without a scale whether its doors are as high as its walkable area takes them to be.
import type { Eye } from '../camera/eye';
import { project } from '../camera/ray';
import { by_id, on_click } from '../page/dom';
import type { PageParts } from '../page/parts';
import { door_ahead, metres_per_unit } from '../walk/door';
import type { WalkMap } from '../walk/walk_map';
import './floor_plan.css';

const svg = 'http://www.w3.org/2000/svg';

type DoorParts = Pick<PageParts, 'view' | 'toolbar'> & {
  readonly set_scale: (metres_per_unit: number) => void;
};

export class DoorQuestion {
  private readonly asks_ = by_id('author-door', HTMLElement);
  private readonly panel_ = by_id('author-panel', HTMLElement);
  private readonly picture_ = document.createElementNS(svg, 'svg');
  private readonly frame_ = document.createElementNS(svg, 'polygon');
  private map_: WalkMap | undefined;

  constructor(private readonly parts_: DoorParts) {
    this.picture_.id = 'door-frame';
    this.picture_.setAttribute('class', 'on-floor');
    this.picture_.setAttribute('aria-hidden', 'true');
    this.picture_.append(this.frame_);
    parts_.view.append(this.picture_);
    on_click('author-door-fits', () => {
      if (this.map_) parts_.set_scale(metres_per_unit(this.map_));
      this.ask(undefined);
    });
    on_click('author-door-differs', () => {
      this.ask(undefined);
      parts_.toolbar.open('measure');
    });
  }

  /** Of this map, or no more. */
  ask(map: WalkMap | undefined): void {
    this.map_ = map;
    this.asks_.hidden = !map;
    if (!map) this.picture_.classList.remove('shown');
  }

  /** The camera of the picture is here now. */
  move(eye: Eye): void {
    const { clientWidth: width, clientHeight: height } = this.parts_.view;
    const door = this.map_ && !this.panel_.hidden ? door_ahead(this.map_, eye) : undefined;
    const corners = door?.map((corner) => project(corner, eye, width / Math.max(1, height)));
    const shown = corners?.every((corner) => corner !== undefined) ?? false;
    this.picture_.classList.toggle('shown', shown);
    if (!corners || !shown) return;
    this.frame_.setAttribute(
      'points',
      corners
        .map((at) => `${(at![0] * width).toFixed(1)},${(at![1] * height).toFixed(1)}`)
        .join(' '),
    );
  }
}
