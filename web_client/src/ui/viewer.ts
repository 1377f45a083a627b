// Makes the parts of the page and starts the worker. Parts listen to each other without passing through here.
import { browser_storage } from '../base/browser_storage';
import { clock_from } from '../base/clock';
import { remember_rung, remembered_rung } from '../decode/decoder_memory';
import { has_webcodecs } from '../decode/video_decoder';
import { GroundUse } from '../ground/mount';
import type { PresenterChoice } from '../present/make_presenter';
import { device_kind } from '../session/device';
import { TourMedia, TourMediaFields } from '../media/tour_media';
import { watch_token, type AccessToken } from '../session/token';
import { factor } from '../text/number';
import { operator } from '../text/operator';
import { text } from '../text/text';
import { WorkerClient } from '../worker/client';
import { make_automation } from './automation';
import type { CardView } from './card';
import { by_id } from './dom';
import { Guide } from './guide';
import { MeasurePanel } from './measure_panel';
import { Navigation } from './navigation';
import { Notice } from './notice';
import { bind_page_events } from './page_events';
import { Pointing } from './pointing';
import { Poster } from './poster';
import { QualityPanel } from './quality_panel';
import { show_scene_title } from './scene_title';
import { SeenCamera } from './seen_camera';
import { SessionStatus } from './session_status';
import { StatsPanel } from './stats_panel';
import { StreamSize } from './stream_size';
import { Toolbar } from './toolbar';
import { Together } from './together';
import { TurnCall } from './turn_call';
import { jpeg_reason } from './wording';

/** Returns the part that shows fatal errors of the page. `scene_id`: empty for the server's first scene. */
export function mount_viewer(card: CardView, token: AccessToken, scene_id: string): SessionStatus {
  const wishes = new URLSearchParams(location.search);
  const view = by_id('view', HTMLElement);
  const clock = clock_from(performance.timeOrigin);
  const reduced_motion = matchMedia('(prefers-reduced-motion: reduce)').matches;
  const storage = browser_storage('localStorage');
  const rung = remembered_rung(storage, navigator.userAgent, Date.now());
  // `?ui=0`, for frames of other pages: nothing but the picture and the tour.
  document.body.classList.toggle('bare', wishes.get('ui') === '0');

  const worker = new WorkerClient();
  const notice = new Notice();
  const stream_size = new StreamSize(view, worker);
  const navigation = new Navigation(view, worker, clock, reduced_motion);
  const toolbar = new Toolbar(navigation);
  const status = new SessionStatus(card, toolbar, worker, token);
  new TurnCall(card, notice, worker);
  new QualityPanel(navigation, stream_size, worker, storage);
  new StatsPanel(worker, toolbar);
  const seen = new SeenCamera(worker, navigation);
  const media = { media: new TourMedia(() => token.value, () => guide.pause()), media_fields: new TourMediaFields() };
  const guide: Guide = new Guide({ view, clock, worker, navigation, seen, toolbar, notice, token, reduced_motion, ...media });
  new MeasurePanel({ view, navigation, toolbar, seen, storage, set_scale: guide.set_scale });
  const ground = new GroundUse({
    ...{ view, clock, worker, navigation, seen, toolbar, notice, token, storage, reduced_motion },
    tour_shown: guide.tour_shown,
    go_to_stop: (index) => guide.go_to_stop(index),
  });
  worker.on('company_moved', ({ places }) => ground.show_people(places));
  const pointing = new Pointing(view, worker, navigation, notice, seen);
  const together = new Together(worker, navigation, toolbar, notice, pointing, reduced_motion);
  together.parted.listen(() => ground.show_people([]));
  bind_page_events(worker);
  window.catgs = make_automation(worker, navigation, clock);

  worker.on('welcome', ({ welcome: { scene, sceneIds } }) => {
    if (scene) show_scene_title(scene, sceneIds.length > 1);
  });
  const poster = new Poster();
  worker.on('presented', () => poster.end());
  navigation.speed_chosen.listen((speed) => notice.show(text.quality.speed_now({ factor: factor(speed) }), 2));
  worker.on('notice', ({ message }) => notice.show(message, 20));
  // Visitors hear what it means to them, and the console has the reason.
  const tell_of_jpeg = (why: string): void => {
    console.warn(why);
    notice.show(text.jpeg.slower, 20);
  };
  worker.on('fallback', ({ message }) => tell_of_jpeg(operator.jpeg.failed_now({ why: message })));
  worker.on('rung', ({ rung: proved }) => remember_rung(proved, storage, navigator.userAgent, Date.now()));

  if (scene_id) void poster.show(location.href, scene_id, token.value);
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
      presenter: presenter_choice(wishes.get('presenter')),
    },
    [canvas],
  );
  const jpeg = jpeg_reason(has_webcodecs(), isSecureContext, rung);
  if (jpeg) tell_of_jpeg(jpeg);
  return status;
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
