// Asks the author of a scene without a scale whether its doors are as high as its walkable area takes them to be.
import type { Eye } from '../camera/eye';
import { by_id, on_click } from '../page/dom';
import type { PageParts } from '../page/parts';
import { door_in_view, metres_per_unit } from '../walk/door';
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

  constructor(
    private readonly parts_: DoorParts,
    private eye_: Eye,
  ) {
    this.picture_.id = 'door-frame';
    this.picture_.setAttribute('class', 'on-floor');
    this.picture_.setAttribute('aria-hidden', 'true');
    this.picture_.append(this.frame_);
    parts_.view.append(this.picture_);
    parts_.toolbar.panel_shown.listen(() => this.show());
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
    this.show();
  }

  /** The camera of the picture is here now. */
  move(eye: Eye): void {
    this.eye_ = eye;
    this.show();
  }

  /** The question is about the frame, so it is asked while the frame is seen. */
  private show(): void {
    const { clientWidth: width, clientHeight: height } = this.parts_.view;
    const corners =
      this.map_ && !this.panel_.hidden
        ? door_in_view(this.map_, this.eye_, width / Math.max(1, height))
        : undefined;
    this.asks_.hidden = !corners;
    this.picture_.classList.toggle('shown', corners !== undefined);
    const points = corners?.map(([x, y]) => `${(x * width).toFixed(1)},${(y * height).toFixed(1)}`);
    if (points) this.frame_.setAttribute('points', points.join(' '));
  }
}
