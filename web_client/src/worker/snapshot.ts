import type { Display } from '../present/display';
import type { SceneCoordinates } from '../session/camera_messages';
import type { FrameHeader } from '../wire/wire';
import type { Snapshot } from './messages';

/** What the canvas shows, in the coordinates of the scene's file; undefined where it cannot be read. */
export function snapshot_of(
  display: Display,
  shown: FrameHeader,
  coordinates: SceneCoordinates,
): Snapshot | undefined {
  let picture;
  try {
    picture = display.read();
  } catch (error) {
    console.warn('the picture cannot be read', error);
  }
  return (
    picture && {
      header: coordinates.header_in_file(shown),
      ...picture,
      view: coordinates.to_file(picture.view),
    }
  );
}
