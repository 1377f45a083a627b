// Which scenes this visitor may enter through portals.
import { target_of, type PortalTarget } from '../portals/portals';
import { list_scenes, type SceneListing } from '../session/scenes';
import type { AccessToken } from '../session/token';
import type { Portal, Tour } from '../tour/tour';
import type { WorkerClient } from '../worker/client';

const prepare_again_ms = 60_000;

export class PortalScenes {
  private scenes_: readonly SceneListing[] = []; // that `scenes_for_` may see
  private scenes_for_ = '';
  private readonly prepared_ms_ = new Map<string, number>();

  constructor(
    private readonly parts_: { readonly worker: WorkerClient; readonly token: AccessToken },
  ) {}

  /** Learns which scenes this visitor may enter, where a tour leads to one. */
  async learn(tours: readonly Tour[]): Promise<void> {
    if (tours.some(({ stops }) => stops.some(({ portal }) => portal))) await this.list();
  }

  async list(): Promise<readonly SceneListing[]> {
    const token = this.parts_.token.value;
    // An empty list is one that could not be had.
    if (this.scenes_.length === 0 || this.scenes_for_ !== token) {
      this.scenes_ = await list_scenes(location.href, token);
      this.scenes_for_ = token;
    }
    return this.scenes_;
  }

  target_of(portal: Portal): PortalTarget {
    return target_of(portal, this.scenes_);
  }

  /** The visitor is near: asks the server to have the scene ready. */
  prepare(portal: Portal): void {
    const { scene_id } = this.target_of(portal);
    const now_ms = performance.now();
    if (!scene_id || now_ms - (this.prepared_ms_.get(scene_id) ?? -Infinity) < prepare_again_ms)
      return;
    this.prepared_ms_.set(scene_id, now_ms);
    this.parts_.worker.post({ kind: 'prepare', scene_id });
  }
}
