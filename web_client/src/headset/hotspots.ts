// The stops of the tour that is shown, as signs in the scene.
import { add, length, sub, type Vec3 } from '../base/vector';
import { number } from '../text/number';
import { text } from '../text/text';
import type { TourState } from '../tour/player';
import type { Stop } from '../tour/tour';
import { font, Sign, type Overlay, type Plate } from './overlay';
import { facing, met_plate, type RoomRay } from './plate';
import type { Target } from './pointers';
import type { Rig } from './rig';

const sign_px = 128;
const label_px = [512, 80] as const;
const half_share = 0.022; // of the distance
const half_range_m = [0.03, 6] as const;
const behind_alpha = 0.25;

interface Spot {
  readonly index: number;
  readonly stop: Stop;
  readonly sign: Sign;
}

interface Seen {
  readonly spot: Spot;
  readonly plate: Plate;
  readonly distance: number;
}

export class SpaceHotspots {
  private readonly label_: Sign;
  private spots_: readonly Spot[] = [];
  private tour_: TourState['tour'];
  private seen_: readonly Seen[] = []; // from far to near
  private pointed_: Spot | undefined;

  constructor(
    private readonly gl_: WebGL2RenderingContext,
    private readonly go_to_: (stop_index: number) => void,
  ) {
    this.label_ = new Sign(gl_, label_px[0]);
  }

  /** Shows the stops of this tour as a visitor sees them from there. */
  look({ tour }: TourState, rig: Rig, eye: Vec3): void {
    if (tour !== this.tour_) this.make(tour);
    this.pointed_ = undefined;
    this.seen_ = this.spots_
      .map((spot) => {
        const middle = rig.to_room(spot.stop.marker!);
        const distance = length(sub(middle, eye));
        const half = Math.min(half_range_m[1], Math.max(half_range_m[0], distance * half_share));
        return { spot, plate: facing(middle, eye, half, half), distance };
      })
      .sort((a, b) => b.distance - a.distance);
  }

  pointed(ray: RoomRay): Target | undefined {
    const met = [...this.seen_].reverse().find(({ plate }) => met_plate(ray, plate));
    if (!met) return undefined;
    const { spot, distance } = met;
    this.pointed_ = spot;
    return { id: `stop ${spot.index}`, distance, press: () => this.go_to_(spot.index) };
  }

  draw(overlay: Overlay): void {
    // The page asks the server which of them the scene hides.
    const hidden = [...document.querySelectorAll('#hotspots .hotspot')].map((button) =>
      button.classList.contains('behind'),
    );
    for (const { spot, plate } of this.seen_) {
      const is_pointed = spot === this.pointed_;
      const alpha = hidden[this.spots_.indexOf(spot)] && !is_pointed ? behind_alpha : 1;
      overlay.sign(spot.sign, plate, alpha);
      if (is_pointed) this.draw_label(overlay, spot, plate);
    }
  }

  private draw_label(overlay: Overlay, { stop, index }: Spot, plate: Plate): void {
    const title = stop.title || text.tour.stop_numbered({ n: index + 1 });
    this.label_.show(title, label_px[1], (context) => {
      const [width, height] = label_px;
      context.font = font(36, 600);
      const shown = Math.min(width, context.measureText(title).width + 40);
      context.fillStyle = 'rgba(16, 18, 24, 0.92)';
      context.beginPath();
      context.roundRect((width - shown) / 2, 0, shown, height, 20);
      context.fill();
      context.fillStyle = '#fff';
      context.textAlign = 'center';
      context.textBaseline = 'middle';
      context.fillText(title, width / 2, height / 2, width - 40);
    });
    const wide = (v: Vec3, s: number): Vec3 => [v[0] * s, v[1] * s, v[2] * s];
    overlay.sign(this.label_, {
      middle: add(plate.middle, wide(plate.down, -1.9)),
      right: wide(plate.right, 4),
      down: wide(plate.down, (4 * label_px[1]) / label_px[0]),
    });
  }

  private make(tour: TourState['tour']): void {
    this.tour_ = tour;
    for (const { sign } of this.spots_) sign.delete();
    this.spots_ = (tour?.stops ?? []).flatMap((stop, index) => {
      if (!stop.marker) return [];
      const sign = new Sign(this.gl_, sign_px);
      sign.show(`${index}`, sign_px, (context) => {
        const middle = sign_px / 2;
        context.fillStyle = stop.portal ? '#0e8f6d' : '#2f6fde';
        context.strokeStyle = '#fff';
        context.lineWidth = 8;
        context.beginPath();
        context.arc(middle, middle, middle - 8, 0, 2 * Math.PI);
        context.fill();
        context.stroke();
        context.fillStyle = '#fff';
        context.font = font(60, 700);
        context.textAlign = 'center';
        context.textBaseline = 'middle';
        context.fillText(number(index + 1), middle, middle + 4);
      });
      return [{ index, stop, sign }];
    });
  }
}
