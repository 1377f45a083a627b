import type { Timers } from '../base/clock';
import { Codec, type StreamConfig } from '../wire/wire';
import { JpegDecoder } from './jpeg_decoder';
import { failures_per_rung, rungs_from, type DecoderRung } from './ladder';
import type { Decoder, DecoderEvents } from './picture';
import { decoder_config, has_webcodecs, is_supported, WebCodecsDecoder } from './video_decoder';

/** Codecs that this browser can decode from `first_rung` down, best first. */
export function available_codecs(first_rung: DecoderRung): Codec[] {
  return has_webcodecs() && first_rung !== 'jpeg' ? [Codec.H264, Codec.MJPEG] : [Codec.MJPEG];
}

export interface MadeDecoder {
  readonly decoder: Decoder;
  readonly rung: DecoderRung;
}

/**
 * Makes the best decoder that is left below `first_rung` after `failures` failures: hardware first,
 * software once hardware has failed. Undefined when none is left.
 */
export async function make_decoder(
  config: StreamConfig,
  first_rung: DecoderRung,
  failures: number,
  now_us: () => number,
  timers: Timers,
  events: DecoderEvents,
): Promise<MadeDecoder | undefined> {
  if (config.codec === Codec.MJPEG) {
    return { decoder: new JpegDecoder(now_us, timers, events), rung: 'jpeg' };
  }
  if (config.codec !== Codec.H264 || !has_webcodecs()) return undefined;
  const rungs = await Promise.all(
    rungs_from(first_rung).map(async (rung) => {
      if (rung === 'jpeg') return [];
      return (await is_supported(decoder_config(config, rung), timers)) ? [rung] : [];
    }),
  );
  const rung = rungs.flat()[Math.floor(failures / failures_per_rung)];
  if (!rung) return undefined;
  return { decoder: new WebCodecsDecoder(config, rung, now_us, events), rung };
}
