// Starts the session in the worker, and shows what becomes of it.
import { load_part, part_missing } from '../base/load_part';
import { remember_rung, remembered_rung } from '../decode/decoder_memory';
import { has_webcodecs } from '../decode/video_decoder';
import { by_id } from '../page/dom';
import type { PageParts } from '../page/parts';
import type { PresenterChoice } from '../present/make_presenter';
import { device_kind } from '../session/device';
import { watch_token } from '../session/token';
import type { console_texts } from '../text/console';
import { text } from '../text/text';
import type { CardView } from './card';
import { bind_page_events } from './page_events';
import { Poster } from './poster';
import { show_scene_title } from './scene_title';
import { SessionStatus } from './session_status';
import type { StreamSize } from './stream_size';
import { TurnCall } from './turn_call';
import { jpeg_reason } from './wording';

/** Returns what tells of an error of the page. `scene_id`: empty for the server's first scene. */
export function mount_session(
  { worker, notice, toolbar, token, storage }: PageParts,
  card: CardView,
  stream_size: StreamSize,
  scene_id: string,
): (message: string) => void {
  const status = new SessionStatus(card, notice, toolbar, worker, token);
  new TurnCall(card, notice, worker);
  worker.on('welcome', ({ welcome: { scene, sceneIds } }) => {
    if (scene) show_scene_title(scene, sceneIds.length > 1);
  });
  worker.on('notice', ({ message }) => notice.show(message, 20));
  part_missing.listen((missing) => {
    if (missing) notice.show(text.cards.part_missing);
    else notice.withdraw(text.cards.part_missing);
  });
  const poster = new Poster();
  worker.on('presented', () => poster.end());
  if (scene_id) void poster.show(location.href, scene_id, token.value);

  const rung = remembered_rung(storage, navigator.userAgent, Date.now());
  worker.on('rung', ({ rung: proved }) =>
    remember_rung(proved, storage, navigator.userAgent, Date.now()),
  );
  // Visitors hear what it means to them, and the console has the reason.
  const tell_of_jpeg = (why: (texts: (typeof console_texts)['jpeg']) => string): void => {
    notice.show(text.jpeg.slower, 20);
    load_part(() => import('../text/console')).then(
      ({ console_texts: { jpeg } }) => console.warn(why(jpeg)),
      (error: unknown) => console.warn('pictures arrive as JPEG', error), // the server is away
    );
  };
  worker.on('fallback', ({ message }) => tell_of_jpeg((jpeg) => jpeg.failed_now({ why: message })));

  const canvas = by_id('picture', HTMLCanvasElement).transferControlToOffscreen();
  worker.post(
    {
      kind: 'start',
      canvas,
      url: location.href,
      page_origin_ms: performance.timeOrigin,
      token: token.value,
      scene_id,
      watch: watch_token(location.href),
      view: stream_size.view,
      quality: stream_size.quality,
      rung,
      device: device_here(),
      presenter: presenter_choice(new URLSearchParams(location.search).get('presenter')),
    },
    [canvas],
  );
  bind_page_events(worker);
  const reason = jpeg_reason(has_webcodecs(), isSecureContext, rung);
  if (reason) tell_of_jpeg((jpeg) => jpeg[reason]);
  return (message) => status.failed(message);
}

const device_here = (): ReturnType<typeof device_kind> =>
  device_kind({
    user_agent: navigator.userAgent,
    coarse_pointer: matchMedia('(pointer: coarse)').matches,
    screen_px: Math.min(screen.width, screen.height),
  });

/** `?presenter=webgl2` and `?presenter=2d` override the page's own choice. */
const presenter_choice = (wanted: string | null): PresenterChoice =>
  wanted === 'webgl2' || wanted === '2d' ? wanted : 'auto';
