import { Codec, type StreamConfig } from '../wire/wire';
import { JpegDecoder } from './jpeg_decoder';
import type { Decoder, DecoderEvents } from './picture';
import { decoder_config, has_webcodecs, supported_accelerations, WebCodecsDecoder } from './video_decoder';

const failures_per_kind = 2; // one may be a broken frame; two are a broken decoder

/** What this browser can decode here, best first. */
export function available_codecs(): Codec[] {
  return has_webcodecs() ? [Codec.H264, Codec.MJPEG] : [Codec.MJPEG];
}

/**
 * The best decoder left after `failures` real failures: hardware first, software when hardware has
 * proved unable. Undefined when none is left.
 */
export async function make_decoder(
  config: StreamConfig,
  failures: number,
  now_us: () => number,
  events: DecoderEvents,
): Promise<Decoder | undefined> {
  if (config.codec === Codec.MJPEG) return new JpegDecoder(now_us, events);
  if (config.codec !== Codec.H264 || !has_webcodecs()) return undefined;
  const kinds = await supported_accelerations(config);
  const kind = kinds[Math.floor(failures / failures_per_kind)];
  return kind && new WebCodecsDecoder(decoder_config(config, kind), now_us, events);
}
