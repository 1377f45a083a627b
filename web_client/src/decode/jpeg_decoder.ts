import type { Timers } from '../base/clock';
import { in_time } from '../base/patience';
import { Codec, type StreamConfig } from '../wire/wire';
import { Latest } from './latest';
import type { Decoder, DecoderEvents, EncodedFrame } from './picture';

/**
 * Decodes Motion JPEG with createImageBitmap. Every browser has it, even without a secure context.
 * Frames are independent, so only the newest one waits while another decodes.
 */
export class JpegDecoder implements Decoder {
  private readonly next_ = new Latest<EncodedFrame>((frame) => this.events_.skipped(frame));
  private current_: EncodedFrame | undefined;

  constructor(
    private readonly now_us_: () => number,
    private readonly timers_: Timers,
    private readonly events_: DecoderEvents,
  ) {}

  decode(frame: EncodedFrame): void {
    this.next_.put(frame);
    if (!this.current_) void this.run();
  }

  reconfigure(config: StreamConfig): boolean {
    return config.codec === Codec.MJPEG;
  }

  close(): void {
    this.next_.clear();
    const current = this.current_;
    this.current_ = undefined;
    if (current) this.events_.skipped(current);
  }

  private async run(): Promise<void> {
    for (let frame = this.next_.take(); frame; frame = this.next_.take()) {
      this.current_ = frame;
      await this.decode_one(frame);
      this.current_ = undefined;
    }
  }

  private async decode_one(frame: EncodedFrame): Promise<void> {
    const blob = new Blob([frame.payload as Uint8Array<ArrayBuffer>], { type: 'image/jpeg' });
    const made = createImageBitmap(blob, { colorSpaceConversion: 'none' });
    try {
      const picture = await in_time(this.timers_, made);
      if (this.current_ !== frame) {
        picture.close(); // the decoder was closed meanwhile
        return;
      }
      frame.decoded_us = this.now_us_();
      this.events_.decoded(frame, picture);
    } catch (error) {
      // A broken JPEG spoils no other frame, so it needs neither a reset nor a key frame.
      console.warn('JPEG frame not decodable', error);
      made.then(
        (late) => late.close(),
        () => undefined,
      );
      if (this.current_ === frame) this.events_.skipped(frame);
    }
  }
}
