// Makes the parts of the page and starts the worker. Parts listen to each other without passing through here.
import { make_editor } from './author_editor';
import { offer_headset } from './headset/offer';
import { TourMedia } from './media/tour_media';
import { make_page_parts } from './page/parts';
import type { AccessToken } from './session/token';
import { make_automation } from './ui/automation';
import { AwakeScreen } from './ui/awake_screen';
import type { CardView } from './ui/card';
import { mount_panels } from './ui/mount_panels';
import { mount_session } from './ui/mount_session';
import { mount_tours } from './ui/mount_tours';
import { Pointing } from './ui/pointing';
import { SharedTour } from './ui/shared_tour';
import { StreamSize } from './ui/stream_size';
import { WalkableArea } from './walkable_area/mount';

/** Returns what tells of an error of the page. `scene_id`: empty for the server's first scene. `is_author`: the editor loads. */
export function mount_viewer(
  card: CardView,
  token: AccessToken,
  scene_id: string,
  is_author: boolean,
): (message: string) => void {
  // `?ui=0`, for frames of other pages: nothing but the picture and the tour.
  document.body.classList.toggle('bare', new URLSearchParams(location.search).get('ui') === '0');
  const parts = make_page_parts(token);
  const { view, worker, navigation, clock } = parts;
  const stream_size = new StreamSize(view, worker);
  const media = new TourMedia(token);
  const { tours, measures, set_scale } = mount_tours(
    parts,
    media,
    is_author ? make_editor : undefined,
  );
  media.enlarged.listen(() => tours.player.pause());
  mount_panels(parts, stream_size, measures, set_scale);
  const walkable_area = new WalkableArea({
    ...parts,
    measures,
    tour_shown: tours.shown,
    go_to_stop: (index) => tours.player.go_to(index),
    set_scale,
  });
  worker.on('participants_moved', ({ positions }) => walkable_area.show_participants(positions));
  const shared_tour = new SharedTour(parts, new Pointing(parts));
  shared_tour.left.listen(() => {
    walkable_area.show_participants([]);
    tours.guide(undefined);
  });
  shared_tour.shown.listen((shown) => tours.guide(shown));
  const screen = new AwakeScreen();
  tours.shown.listen(({ playing }) => screen.watch('tour', playing));
  shared_tour.takes_part.listen((takes_part) => screen.watch('leader', takes_part));
  offer_headset({ ...parts, tours, measures, walkable_area });
  window.catgs = make_automation(worker, navigation, clock);
  return mount_session(parts, card, stream_size, scene_id);
}
