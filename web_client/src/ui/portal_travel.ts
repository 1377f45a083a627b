// Takes visitors through portals. The old picture covers the new scene until that has one from where they arrive.
import { same_view } from '../camera/same_view';
import { make } from '../page/dom';
import type { PageParts } from '../page/parts';
import { address_in, address_led_to, arrival } from '../portals/portals';
import { scene_name } from '../session/scenes';
import type { SharedView } from '../tour/share';
import type { Portal } from '../tour/tour';

const longest_cover_ms = 5000; // after the arrival
const fade_ms = 400; // and a little

export class PortalTravel {
  /** `by`: the portal; undefined: the browser's history. */
  private going_: { readonly by: Portal | undefined; readonly scene_id: string } | undefined;
  private awaited_: number | undefined; // the pose whose picture uncovers it, or a later one
  private cover_ends_: ReturnType<typeof setTimeout> | undefined;
  private cover_: HTMLCanvasElement | undefined;

  /** `present`: the view that the visitor has now. */
  constructor(
    private readonly parts_: Pick<PageParts, 'view' | 'worker' | 'navigation' | 'notice'>,
    private readonly present_: () => SharedView,
  ) {
    const { worker, navigation } = parts_;
    worker.on('stayed', ({ message }) => this.stay(message));
    worker.on('state', ({ state }) => {
      if (state.phase === 'failed') this.stay();
    });
    worker.on('presented', ({ pose_id, eye }) => {
      if (this.awaited_ === undefined) return;
      // The server does not draw a pose again that gives the same picture.
      const { camera } = navigation;
      if (pose_id >= this.awaited_ || same_view(eye, camera.pose, camera.scene)) this.uncover();
    });
    window.addEventListener('popstate', () => {
      if (this.leads_elsewhere) void this.go(undefined, this.address_scene);
    });
  }

  /** The address is that of another scene than the one where the visitor is or goes. */
  get leads_elsewhere(): boolean {
    const { scene_id } = this.going_ ?? this.parts_.navigation;
    return ![scene_id, scene_name(scene_id), ''].includes(this.address_scene);
  }

  enter(portal: Portal, scene_id: string): void {
    if (!this.going_) void this.go(portal, scene_id);
  }

  /** The other scene is there. Returns where the visitor arrives; undefined: as the address says. */
  arrive(scene_id: string): SharedView | undefined {
    const { camera, led } = this.parts_.navigation;
    // Otherwise, the history would lead away from where somebody has led this visitor.
    if (!this.going_ && led && this.leads_elsewhere)
      history.replaceState(null, '', address_led_to(location.href, scene_id));
    const by = this.going_?.by;
    if (!by) return undefined;
    const view = arrival(by, camera.up, camera.fov_y_rad);
    history.pushState(null, '', address_in(location.href, scene_id, view));
    return view;
  }

  /** The camera is where the visitor arrives. */
  arrived(): void {
    if (!this.going_) return;
    this.going_ = undefined;
    this.awaited_ = this.parts_.navigation.loop.sample();
    this.cover_ends_ = setTimeout(() => this.uncover(), longest_cover_ms);
  }

  private get address_scene(): string {
    return new URLSearchParams(location.search).get('scene') ?? '';
  }

  private async go(by: Portal | undefined, scene_id: string): Promise<void> {
    const { navigation, worker } = this.parts_;
    navigation.taken_over.emit();
    // The way back through a portal leads to this view.
    if (by)
      history.replaceState(
        null,
        '',
        address_in(location.href, navigation.scene_id, this.present_()),
      );
    this.going_ = { by, scene_id };
    this.awaited_ = undefined;
    clearTimeout(this.cover_ends_);
    await this.cover();
    worker.post({ kind: 'select', scene_id });
  }

  /** The server does not let the visitor in. */
  private stay(why?: string): void {
    const { navigation, notice } = this.parts_;
    if (why) notice.show(why, 20);
    if (this.going_ && !this.going_.by)
      history.replaceState(
        null,
        '',
        address_in(location.href, navigation.scene_id, this.present_()),
      );
    this.going_ = undefined;
    this.uncover();
  }

  private async cover(): Promise<void> {
    const snapshot = await this.parts_.worker.snapshot();
    if (!snapshot || this.cover_) return;
    const { width_px: width, height_px: height, rgba } = snapshot;
    this.cover_ = make('canvas', { width, height, className: 'cover', 'aria-hidden': 'true' });
    this.cover_.getContext('2d')?.putImageData(new ImageData(rgba, width, height), 0, 0);
    this.parts_.view.append(this.cover_);
  }

  private uncover(): void {
    const { cover_: cover } = this;
    this.awaited_ = undefined;
    this.cover_ = undefined;
    cover?.classList.add('over'); // fades
    setTimeout(() => cover?.remove(), fade_ms);
  }
}
