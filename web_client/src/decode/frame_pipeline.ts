// From received bytes to the picture that is shown: decoder, newest-wins slot, presenter, and one
// acknowledgement per frame, whatever became of it. Each step has a longest time.
import { clamp } from '../base/vector';
import type { Timers } from '../base/clock';
import { after_awake, in_time, longest_step_s } from '../base/patience';
import { Codec, type AckInit, type FrameHeader, type StreamConfig } from '../wire/wire';
import { failures_per_rung } from './ladder';
import { Latest } from './latest';
import type { Decoder, DecoderEvents, EncodedFrame, Frame, Picture } from './picture';

export interface PipelineEnvironment {
  now_us: () => number;
  timers: Timers;
  /** A new decoder for the stream; undefined when this browser has none (left). */
  make_decoder: (
    config: StreamConfig,
    failures: number,
    events: DecoderEvents,
  ) => Promise<Decoder | undefined>;
  /** Calls back before the next refresh of the display. */
  on_refresh: (draw: () => void) => void;
  /**
   * One at a time; the picture is free when the promise resolves: with the time at which the visitor sees it, where
   * that is not then; with 0 where nobody does.
   */
  draw: (picture: Picture, header: FrameHeader) => Promise<number | undefined>;
}

export interface PipelineListener {
  ack(ack: AckInit): void;
  presented(frame: Frame, presented_us: number): void;
  dropped(frame: Frame): void;
  /** The decoder needs a key frame to begin with. */
  key_frame_wanted(): void;
  /** No decoder of this browser can play the stream. */
  undecodable(message: string): void;
}

const waiting_limit = 8; // frames that may wait for a decoder to be made

export class FramePipeline {
  private config_: StreamConfig | undefined;
  private decoder_: Decoder | undefined;
  private generation_ = 0; // a decoder of an older generation has nothing more to say
  private streams_ended_ = 0;
  private failures_ = 0;
  private needs_key_ = true;
  private hidden_ = false;
  private gave_picture_ = false; // the decoder
  private waiting_: EncodedFrame[] = [];
  private readonly inside_ = new Set<Frame>(); // the decoder
  private cancel_watch_: () => void = () => undefined;
  private drawing_ = false;
  private readonly newest_: Latest<{ frame: Frame; picture: Picture }>;

  constructor(
    private readonly env_: PipelineEnvironment,
    private readonly listener_: PipelineListener,
  ) {
    this.newest_ = new Latest(({ frame, picture }) => {
      picture.close();
      this.drop(frame);
    });
  }

  configure(config: StreamConfig): void {
    this.config_ = config;
    // A picture that comes to rest and moves on changes the stream twice: to make a decoder each time
    // would cost a look at what the browser supports, and the decoder's warm-up.
    if (this.decoder_?.reconfigure(config)) {
      this.needs_key_ = true;
      this.failures_ -= this.failures_ % failures_per_rung; // what cost a rung stays counted
      return;
    }
    this.failures_ = 0;
    void this.renew_decoder();
  }

  push(header: FrameHeader, payload: Uint8Array): void {
    const received_us = this.env_.now_us();
    const frame = { header, payload, received_us, decoded_us: 0 };
    if ((this.needs_key_ && !header.idr) || (this.hidden_ && !this.decoder_)) {
      this.drop(frame);
      return;
    }
    this.needs_key_ = false;
    if (this.decoder_) {
      this.decode(this.decoder_, frame);
    } else if (this.waiting_.length < waiting_limit) {
      this.waiting_.push(frame);
    } else {
      this.drop(frame);
      this.want_key_frame();
    }
  }

  /** A hidden page draws nothing, and makes no decoder: browsers take decoders back from hidden pages. */
  set hidden(hidden: boolean) {
    this.hidden_ = hidden;
    this.newest_.clear();
    this.watch();
    if (hidden || this.decoder_ || !this.config_) return;
    void this.renew_decoder();
    this.listener_.key_frame_wanted();
  }

  /** Drops every frame inside: the stream they belong to has ended. What is shown stays shown. */
  end_stream(): void {
    this.generation_ += 1;
    this.streams_ended_ += 1;
    this.cancel_watch_();
    this.decoder_?.close();
    this.decoder_ = undefined;
    this.drop_waiting();
    this.newest_.clear();
    this.config_ = undefined;
    this.needs_key_ = true;
  }

  private async renew_decoder(): Promise<void> {
    const generation = ++this.generation_;
    this.decoder_?.close();
    this.decoder_ = undefined;
    this.cancel_watch_();
    this.drop_waiting();
    this.needs_key_ = true;
    this.gave_picture_ = false;
    const config = this.config_;
    if (!config || this.hidden_) return;
    const failed = (error: unknown): void => {
      if (generation === this.generation_) this.failed(error);
    };
    const made = this.env_.make_decoder(config, this.failures_, {
      decoded: (frame, picture) => {
        if (generation === this.generation_) this.decoded(frame, picture);
        else picture.close();
      },
      skipped: (frame) => {
        this.drop(frame);
        if (generation === this.generation_) this.watch();
      },
      failed,
    });
    let decoder;
    try {
      decoder = await in_time(this.env_.timers, made);
    } catch (error) {
      made.then(
        (late) => late?.close(),
        () => undefined,
      );
      return failed(error);
    }
    if (generation !== this.generation_) {
      decoder?.close();
    } else if (!decoder) {
      const codec = config.codec === Codec.H264 ? config.codecString : Codec[config.codec];
      this.listener_.undecodable(`no decoder for ${codec}`);
    } else {
      this.decoder_ = decoder;
      for (const frame of this.waiting_.splice(0)) {
        // A frame on which it fails closes it; those behind need another key frame anyway.
        if (generation === this.generation_) this.decode(decoder, frame);
        else this.drop(frame);
      }
    }
  }

  private decode(decoder: Decoder, frame: EncodedFrame): void {
    this.inside_.add(frame);
    if (this.inside_.size === 1) this.watch();
    decoder.decode(frame);
  }

  /** Waits for the next sign of life of the decoder: some give neither a picture nor an error. */
  private watch(): void {
    this.cancel_watch_();
    if (this.inside_.size === 0 || this.hidden_) return;
    this.cancel_watch_ = after_awake(this.env_.timers, longest_step_s, () =>
      this.failed(new Error('the decoder gives neither a picture nor an error')),
    );
  }

  /** A decoder that worked until the browser took it back has not failed. */
  private failed(error: unknown): void {
    console.warn('video decoder failed', error);
    const is_reclaimed = error instanceof Error && error.name === 'QuotaExceededError';
    if (!this.hidden_ && !(is_reclaimed && this.gave_picture_)) this.failures_ += 1;
    void this.renew_decoder();
    if (!this.hidden_) this.listener_.key_frame_wanted();
  }

  private want_key_frame(): void {
    this.drop_waiting();
    this.needs_key_ = true;
    this.listener_.key_frame_wanted();
  }

  private drop_waiting(): void {
    for (const frame of this.waiting_.splice(0)) this.drop(frame);
  }

  private decoded(frame: Frame, picture: Picture): void {
    this.inside_.delete(frame);
    this.gave_picture_ = true;
    this.watch();
    this.newest_.put({ frame, picture });
    if (this.hidden_) return this.newest_.clear();
    if (!this.drawing_) this.draw_at_refresh();
  }

  private draw_at_refresh(): void {
    this.drawing_ = true;
    this.env_.on_refresh(() => {
      void this.present().finally(() => {
        this.drawing_ = false;
        if (this.newest_.full) this.draw_at_refresh();
      });
    });
  }

  private async present(): Promise<void> {
    const newest = this.newest_.take();
    if (!newest) return;
    const { frame, picture } = newest;
    const streams_ended = this.streams_ended_;
    let error: unknown;
    let seen_us: number | undefined;
    try {
      seen_us = await in_time(this.env_.timers, this.env_.draw(picture, frame.header));
    } catch (thrown) {
      error = thrown ?? new Error('the picture cannot be drawn');
    } finally {
      picture.close();
    }
    // The connection went while the picture was drawn: nobody waits for the acknowledgement.
    if (this.streams_ended_ !== streams_ended) return;
    if (error !== undefined) {
      this.drop(frame);
      this.failed(error); // another way to decode may give pictures that can be drawn
      return;
    }
    if (seen_us === 0) return this.drop(frame);
    const presented_us = seen_us ?? this.env_.now_us();
    this.ack(frame, presented_us);
    this.listener_.presented(frame, presented_us);
  }

  private drop(frame: Frame): void {
    this.inside_.delete(frame);
    this.ack(frame, 0);
    this.listener_.dropped(frame);
  }

  private ack(frame: Frame, presented_us: number): void {
    const age_us = presented_us - Number(frame.header.poseClientTimeUs);
    this.listener_.ack({
      frameId: frame.header.frameId,
      receivedUs: BigInt(frame.received_us),
      decodedUs: BigInt(frame.decoded_us),
      presentedUs: BigInt(presented_us),
      dropped: presented_us === 0,
      poseAgeUs: presented_us === 0 ? 0 : clamp(age_us, 0, 0xffffffff),
    });
  }
}
