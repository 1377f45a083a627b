// Fetches where people can walk in the scene: when somebody walks or opens the plan, or else when the page is idle.
import { load_part } from '../base/load_part';
import { ask_server, scene_path } from '../base/server';
import { Signal } from '../base/signal';
import type { AccessToken } from '../session/token';
import type { WalkMap } from '../walk/walk_map';

const most_idle_bytes = 1_000_000;
const patience_ms = 10 * 60_000; // the server computes one scene at a time
const usual_wait_s = 5;

export class WalkMapLoader {
  /** The map of the scene is there; undefined: nobody can walk in it; 'large': it comes when it is wanted. */
  readonly known = new Signal<WalkMap | 'large' | undefined>();
  /** Somebody waits for the map, and the server still computes it. Comes once a scene. */
  readonly computing = new Signal();
  private scene_id_ = '';
  private state_: 'unknown' | 'asked' | 'large' | 'known' = 'unknown';
  private wait_: 'no' | 'quietly' | 'told' = 'no';
  private idle_ = false; // nobody waits for the map

  constructor(private readonly token_: AccessToken) {}

  /** The visitor is in this scene now. */
  enter(scene_id: string): void {
    this.scene_id_ = scene_id;
    this.state_ = 'unknown';
    this.wait_ = 'no';
  }

  /** `idle`: nobody waits for it. */
  async want(idle = false): Promise<void> {
    if (!idle) this.idle_ = false;
    this.tell();
    if (
      !this.scene_id_ ||
      this.state_ === 'asked' ||
      this.state_ === 'known' ||
      (idle && this.state_ !== 'unknown')
    )
      return;
    this.idle_ = idle;
    const scene_id = this.scene_id_;
    this.state_ = 'asked';
    const file = await this.fetch_file(scene_id).catch((error: unknown) => {
      console.warn('the walk map does not come', error);
      return 'unknown' as const; // the next one who needs it asks again
    });
    if (scene_id !== this.scene_id_) return;
    if (file === 'large' || file === 'unknown') {
      this.state_ = file;
      if (file === 'large') this.known.emit(file);
      return;
    }
    const map = file && (await this.read(file));
    if (scene_id !== this.scene_id_) return;
    this.state_ = 'known';
    this.known.emit(map);
  }

  private tell(): void {
    if (this.state_ !== 'asked' || this.idle_ || this.wait_ !== 'quietly') return;
    this.wait_ = 'told';
    this.computing.emit();
  }

  private async read(file: ArrayBuffer): Promise<WalkMap | undefined> {
    try {
      const { read_walk_file } = await load_part(() => import('../walk/walk_map'));
      return await read_walk_file(file);
    } catch (error: unknown) {
      console.warn(error);
      return undefined;
    }
  }

  private async fetch_file(scene_id: string): Promise<ArrayBuffer | 'large' | undefined> {
    const path = scene_path(scene_id, 'walk');
    for (
      const end_ms = Date.now() + patience_ms;
      Date.now() < end_ms && scene_id === this.scene_id_;

    ) {
      const stop = new AbortController();
      const answer = await ask_server(location.href, this.token_.value, path, {
        signal: stop.signal,
      });
      if (answer.status === 200) {
        if (!this.idle_ || Number(answer.headers.get('content-length') ?? 0) <= most_idle_bytes)
          return answer.arrayBuffer();
        stop.abort();
        return 'large';
      }
      if (answer.status !== 202 || scene_id !== this.scene_id_) return undefined;
      if (this.wait_ === 'no') this.wait_ = 'quietly';
      this.tell();
      const wait_s = Number(answer.headers.get('retry-after') ?? usual_wait_s);
      await new Promise((resolve) => setTimeout(resolve, wait_s * 1000));
    }
    return undefined;
  }
}
