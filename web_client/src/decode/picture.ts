import type { FrameHeader, StreamConfig } from '../wire/wire';

/** Decoded pixels. The holder must close() it, because decoders have only a few to give. */
export type Picture = VideoFrame | ImageBitmap;

/** One frame on its way through the client. Times in microseconds of the page's clock. */
export interface Frame {
  readonly header: FrameHeader;
  readonly received_us: number;
  decoded_us: number; // 0 until decoded
}

/** A frame with its bitstream, before decoding. */
export interface EncodedFrame extends Frame {
  readonly payload: Uint8Array;
}

export interface DecoderEvents {
  /** Ownership of `picture` passes to the receiver. */
  decoded(frame: Frame, picture: Picture): void;
  /** The frame will never be decoded. */
  skipped(frame: Frame): void;
  /** The decoder cannot go on without a reset. All frames inside it are lost. */
  failed(error: Error): void;
}

export interface Decoder {
  decode(frame: EncodedFrame): void;
  /**
   * Goes on with another stream from its next key frame. Frames inside still come out. Returns false,
   * and stays as it was, when it cannot.
   */
  reconfigure(config: StreamConfig): boolean;
  /** Skips every frame inside at once. No event follows. */
  close(): void;
}
