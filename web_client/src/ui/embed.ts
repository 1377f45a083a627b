// Lets the page that shows this one in a frame drive it. The server names the pages that may do so
// (--embed-origin). Browsers do not load this page in other frames, so the parent window is one of them.
import type { Eye } from '../camera/eye';
import { JsonField } from '../tour/json_field';
import { max_stops } from '../tour/limits';
import type { TourPlayer } from '../tour/player';

interface EmbedTarget {
  readonly player: Pick<TourPlayer, 'go_to' | 'next' | 'previous' | 'play' | 'pause'>;
  readonly navigation: { readonly eye: Eye; reset(): void };
  put(eye: Eye): void;
}

/** Messages to the parent, sent once it has said hello. */
type EmbedNews =
  | { readonly catgs: 'ready'; readonly scene: string; readonly stops: readonly string[] }
  | { readonly catgs: 'stop'; readonly stop: number | null; readonly playing: boolean }
  | {
      readonly catgs: 'pose';
      readonly position: readonly number[];
      readonly orientation: readonly number[];
      readonly fov_deg: number;
      readonly view_height: number | undefined;
    };

export class EmbedApi {
  private origin_: string | undefined; // origin of the parent, once it has spoken
  private ready_: EmbedNews | undefined;

  constructor(
    private readonly target_: EmbedTarget,
    private readonly window_: Window = window,
  ) {
    if (window_.parent === window_) return;
    window_.addEventListener('message', (event) => {
      if (event.source !== window_.parent) return;
      try {
        this.heard(new JsonField('message', event.data), event.origin);
      } catch (error) {
        console.warn('a message of the page around this one was not understood', error);
      }
    });
  }

  /** `ready` is repeated to a parent that says hello later. */
  say(news: EmbedNews): void {
    if (news.catgs === 'ready') this.ready_ = news;
    if (this.origin_ !== undefined) this.window_.parent.postMessage(news, this.origin_);
  }

  private heard(message: JsonField, origin: string): void {
    const command = message.find('catgs')?.text();
    if (command === undefined) return; // the message is for something else
    this.origin_ = origin;
    switch (command) {
      case 'hello':
        if (this.ready_) this.say(this.ready_);
        break;
      case 'stop':
        this.target_.player.go_to(message.at('stop').number(0, max_stops - 1));
        break;
      case 'pose':
        this.set_pose(message);
        break;
      case 'get_pose':
        this.tell_pose();
        break;
      case 'next':
      case 'previous':
      case 'play':
      case 'pause':
        this.target_.player[command]();
        break;
      case 'reset':
        this.target_.navigation.reset();
        break;
      default:
        throw new Error(`'${command}' is no command`);
    }
  }

  private set_pose(message: JsonField): void {
    this.target_.put({
      position: message.at('position').vec3(),
      orientation: message.at('orientation').orientation(),
      fov_y_rad: message.find('fov_deg')?.fov_rad() ?? this.target_.navigation.eye.fov_y_rad,
      view_height: message.find('view_height')?.number(1e-6),
    });
  }

  private tell_pose(): void {
    const { position, orientation, fov_y_rad, view_height } = this.target_.navigation.eye;
    const fov_deg = (fov_y_rad * 180) / Math.PI;
    this.say({ catgs: 'pose', position, orientation, fov_deg, view_height });
  }
}
