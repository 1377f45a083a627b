import { Latest } from './latest';
import type { Decoder, DecoderEvents, EncodedFrame } from './picture';

/**
 * Motion JPEG by createImageBitmap, which every browser has, also on pages without a secure
 * context. Frames are independent, so while one decodes only the newest waits.
 */
export class JpegDecoder implements Decoder {
  private readonly next_: Latest<EncodedFrame>;
  private busy_ = false;
  private closed_ = false;

  constructor(
    private readonly now_us_: () => number,
    private readonly events_: DecoderEvents,
  ) {
    this.next_ = new Latest((frame) => {
      if (!this.closed_) this.events_.skipped(frame);
    });
  }

  decode(frame: EncodedFrame): void {
    this.next_.put(frame);
    if (!this.busy_) void this.run();
  }

  queue_length(): number {
    return this.busy_ ? 1 : 0;
  }

  close(): void {
    this.closed_ = true;
    this.next_.clear();
  }

  private async run(): Promise<void> {
    this.busy_ = true;
    for (let frame = this.next_.take(); frame; frame = this.next_.take()) {
      await this.decode_one(frame);
    }
    this.busy_ = false;
  }

  private async decode_one(frame: EncodedFrame): Promise<void> {
    const blob = new Blob([frame.payload as Uint8Array<ArrayBuffer>], { type: 'image/jpeg' });
    try {
      const picture = await createImageBitmap(blob, { colorSpaceConversion: 'none' });
      if (this.closed_) {
        picture.close();
        return;
      }
      frame.decoded_us = this.now_us_();
      this.events_.decoded(frame, picture);
    } catch (error) {
      // A broken JPEG spoils itself only: no reset, no new key frame.
      if (!this.closed_) this.events_.skipped(frame);
      console.warn('JPEG frame not decodable', error);
    }
  }
}
