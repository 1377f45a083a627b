// Hands pictures to the page while the visitor wears a headset, because workers have no WebXR.
import type { Eye } from '../camera/eye';
import type { Picture } from '../decode/picture';
import type { FrameHeader, SettingsInit } from '../wire/wire';

/** What a headset wants of the server. */
export interface HeadsetStream {
  /** Of pictures of both eyes. */
  readonly settings: SettingsInit;
  /** Field of view of servers that know of one eye only. */
  readonly fov_y_rad: number;
}

/** A picture on its way to a headset. */
export interface HeadsetPicture {
  readonly kind: 'picture';
  /** The receiver closes it. */
  readonly picture: Picture;
  readonly header: FrameHeader;
  /** The camera of the picture, in the coordinates of the scene's file; of pictures of both eyes, the head. */
  readonly eye: Eye;
}

export class HeadsetOutput {
  private shown_: (seen_us: number) => void = () => undefined;

  constructor(
    public stream: HeadsetStream,
    private readonly say_: (message: HeadsetPicture, transfer: Transferable[]) => void,
  ) {}

  /** Resolves with the time at which the visitor sees the picture, when the page has drawn it. */
  draw(picture: Picture, header: FrameHeader, eye: Eye): Promise<number> {
    return new Promise((resolve) => {
      this.shown_ = resolve;
      this.say_({ kind: 'picture', picture, header, eye }, [picture]);
    });
  }

  shown(seen_us: number): void {
    this.shown_(seen_us);
  }
}

/** What hands on pictures from now on. A picture on the way to a headset that goes is not seen any more. */
export function output_for(
  stream: HeadsetStream | undefined,
  before: HeadsetOutput | undefined,
  say: ConstructorParameters<typeof HeadsetOutput>[1],
): HeadsetOutput | undefined {
  if (before && stream) {
    before.stream = stream;
    return before;
  }
  before?.shown(0);
  return stream && new HeadsetOutput(stream, say);
}

/**
 * Draws what the left eye sees in a picture of both, for pages without a headset: those that watch somebody with
 * one, and those whose visitor has just taken it off.
 */
export async function draw_left_half(
  picture: Picture,
  header: FrameHeader,
  draw: (picture: Picture, header: FrameHeader) => Promise<void>,
): Promise<void> {
  const widthPx = header.widthPx / 2;
  const { up = 0, down = 0 } = header.stereo?.left ?? {};
  const left = await createImageBitmap(picture, 0, 0, widthPx, header.heightPx);
  try {
    // The depths are those of both eyes.
    const fovYRad = 2 * Math.atan((down - up) / 2);
    await draw(left, { ...header, widthPx, fovYRad, depthColumns: 0 });
  } finally {
    left.close();
  }
}
