import { afterEach, describe, expect, it, vi } from 'vitest';
import { refreshes } from '#client/base/patience';
import { JpegDecoder } from '#client/decode/jpeg_decoder';
import { make_presenter } from '#client/present/make_presenter';
import { FrameHeaderSchema } from '#client/wire/wire';
import { frame_sizes } from '#client/worker/frame_sizes';
import { create } from '@bufbuild/protobuf';
import { FakeTime } from './fakes';

afterEach(() => void vi.unstubAllGlobals());

/** A context that takes every call. */
const context = (most_px: number): object =>
  new Proxy({}, { get: (_, name) => (name === 'getParameter' ? () => most_px : () => ({})) });

describe.each([
  ['webgl2', 'webglcontextlost', 'webglcontextrestored', 4096],
  ['2d', 'contextlost', 'contextrestored', Infinity],
] as const)('the %s presenter', (kind, lost, restored, most_px) => {
  it('asks for a picture when the GPU gives the canvas back', () => {
    let emptied = 0;
    const canvas = Object.assign(new EventTarget(), {
      getContext: (asked: string) => (asked === kind ? context(4096) : null),
    }) as unknown as OffscreenCanvas;
    const presenter = make_presenter(canvas, kind, () => (emptied += 1));
    expect(presenter.most_px).toBe(most_px);
    canvas.dispatchEvent(new Event(lost, { cancelable: true }));
    expect(emptied).toBe(0);
    canvas.dispatchEvent(new Event(restored));
    expect(emptied).toBe(1);
  });
});

describe('frame sizes', () => {
  const view = { width_px: 3840, height_px: 2160 };
  const quality = { height_px: 1080, still_height_px: 0, max_fps: 0 };

  it('are even, in the aspect of the view, and larger by the overscan', () => {
    expect(frame_sizes(view, quality, { x: 1.6, y: 1.26 }, Infinity)).toMatchObject({
      widthPx: 3072,
      heightPx: 1360,
      stillWidthPx: 6144,
      stillHeightPx: 2722,
    });
  });

  it('are none that the GPU cannot draw', () => {
    expect(frame_sizes(view, quality, { x: 1.6, y: 1.26 }, 4096)).toMatchObject({
      widthPx: 3072,
      heightPx: 1360,
      stillWidthPx: 4096,
      stillHeightPx: 1814,
    });
  });
});

describe('a refresh of the display', () => {
  it('is not awaited where none comes, and counts once', () => {
    const time = new FakeTime();
    let [asked, drawn] = [(): void => undefined, 0];
    const on_refresh = refreshes((draw) => (asked = draw), time);
    on_refresh(() => (drawn += 1));
    time.advance(499);
    expect(drawn).toBe(0);
    time.advance(1);
    asked();
    expect(drawn).toBe(1);
  });
});

describe('a JPEG that the browser never decodes', () => {
  it('does not stop the next one', async () => {
    vi.spyOn(console, 'warn').mockImplementation(() => undefined);
    let give: (late: { close: () => void }) => void;
    const late = new Promise((resolve) => (give = resolve));
    const pictures = [late, Promise.resolve({ close: () => undefined })];
    vi.stubGlobal('createImageBitmap', () => pictures.shift());
    const time = new FakeTime();
    const [decoded, skipped]: bigint[][] = [[], []];
    const decoder = new JpegDecoder(() => 1, time, {
      decoded: (frame) => decoded!.push(frame.header.frameId),
      skipped: (frame) => skipped!.push(frame.header.frameId),
      failed: () => undefined,
    });
    for (const frameId of [1n, 2n]) {
      const header = create(FrameHeaderSchema, { frameId, idr: true });
      decoder.decode({ header, payload: new Uint8Array(1), received_us: 0, decoded_us: 0 });
    }
    for (let i = 0; i < 3; ++i) time.advance(1000);
    await vi.waitFor(() => expect([skipped, decoded]).toEqual([[1n], [2n]]));
    let closed = false;
    give!({ close: () => (closed = true) });
    await vi.waitFor(() => expect(closed).toBe(true));
    vi.restoreAllMocks();
  });
});
