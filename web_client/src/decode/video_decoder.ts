import type { Timers } from '../base/clock';
import { in_time } from '../base/patience';
import { Codec, type StreamConfig } from '../wire/wire';
import type { Decoder, DecoderEvents, EncodedFrame } from './picture';

export function has_webcodecs(): boolean {
  return typeof VideoDecoder !== 'undefined' && typeof EncodedVideoChunk !== 'undefined';
}

/** Annex B streams need no `description`, because parameter sets travel with every IDR. */
export function decoder_config(
  config: StreamConfig,
  acceleration: HardwareAcceleration,
): VideoDecoderConfig {
  return {
    codec: config.codecString,
    codedWidth: config.widthPx,
    codedHeight: config.heightPx,
    optimizeForLatency: true,
    hardwareAcceleration: acceleration,
  };
}

export async function is_supported(config: VideoDecoderConfig, timers: Timers): Promise<boolean> {
  try {
    return (await in_time(timers, VideoDecoder.isConfigSupported(config))).supported === true;
  } catch (error) {
    console.warn('the browser does not say whether it decodes', config, error);
    return false;
  }
}

/** Decodes H.264 with WebCodecs. One frame gives one picture; the frame id travels as the timestamp. */
export class WebCodecsDecoder implements Decoder {
  private readonly decoder_: VideoDecoder;
  private readonly inside_ = new Map<number, EncodedFrame>();

  constructor(
    config: StreamConfig,
    private readonly acceleration_: HardwareAcceleration,
    private readonly now_us_: () => number,
    private readonly events_: DecoderEvents,
  ) {
    this.decoder_ = new VideoDecoder({
      output: (picture) => this.output(picture),
      error: (error) => this.events_.failed(error),
    });
    this.decoder_.configure(decoder_config(config, acceleration_));
  }

  decode(frame: EncodedFrame): void {
    const timestamp = Number(frame.header.frameId);
    this.inside_.set(timestamp, frame);
    try {
      this.decoder_.decode(
        new EncodedVideoChunk({
          type: frame.header.idr ? 'key' : 'delta',
          timestamp,
          data: frame.payload,
        }),
      );
    } catch (error) {
      // close() may have run already, so the frame is not left for it.
      this.inside_.delete(timestamp);
      this.events_.skipped(frame);
      this.events_.failed(error instanceof Error ? error : new Error(String(error)));
    }
  }

  /** A stream that the decoder cannot play after all shows up as a failure. */
  reconfigure(config: StreamConfig): boolean {
    if (config.codec !== Codec.H264 || this.decoder_.state !== 'configured') return false;
    try {
      this.decoder_.configure(decoder_config(config, this.acceleration_));
      return true;
    } catch (error) {
      console.warn('the decoder takes no other stream', error);
      return false;
    }
  }

  close(): void {
    for (const frame of this.inside_.values()) this.events_.skipped(frame);
    this.inside_.clear();
    if (this.decoder_.state !== 'closed') this.decoder_.close();
  }

  private output(picture: VideoFrame): void {
    const frame = this.inside_.get(picture.timestamp);
    if (!frame) {
      picture.close();
      return;
    }
    // Pictures come in decoding order, so older frames that are still inside gave none.
    for (const [timestamp, older] of this.inside_) {
      if (timestamp > picture.timestamp) break;
      this.inside_.delete(timestamp);
      if (older !== frame) this.events_.skipped(older);
    }
    frame.decoded_us = this.now_us_();
    this.events_.decoded(frame, picture);
  }
}
