import { create } from '@bufbuild/protobuf';
import { beforeEach, describe, expect, it, vi } from 'vitest';
import { remember_rung, remembered_rung } from '#client/decode/decoder_memory';
import { available_codecs, make_decoder } from '#client/decode/make_decoder';
import type { DecoderRung } from '#client/decode/ladder';
import type { DecoderEvents } from '#client/decode/picture';
import { Codec, StreamConfigSchema } from '#client/wire/wire';
import { FakeTime, fake_storage } from './fakes';

const week_ms = 7 * 24 * 3600 * 1000;

describe('what is remembered of decoders', () => {
  it('is where decoding worked, for this browser and a week', () => {
    const storage = fake_storage();
    expect(remembered_rung(storage, 'Browser/1', 0)).toBe('prefer-hardware');
    remember_rung('prefer-software', storage, 'Browser/1', 0);
    expect(remembered_rung(storage, 'Browser/1', week_ms - 1)).toBe('prefer-software');
    expect(remembered_rung(storage, 'Browser/1', week_ms)).toBe('prefer-hardware');
    expect(remembered_rung(storage, 'Browser/2', 0)).toBe('prefer-hardware');
  });

  it('is nothing where it makes no sense', () => {
    const warned = vi.spyOn(console, 'warn').mockImplementation(() => undefined);
    const storage = fake_storage();
    storage.setItem('catgs.decoder', '{ broken');
    expect(remembered_rung(storage, 'a', 0)).toBe('prefer-hardware');
    expect(warned).toHaveBeenCalled();
    storage.setItem('catgs.decoder', '{"rung":"magic","agent":"a","until_ms":9}');
    expect(remembered_rung(storage, 'a', 0)).toBe('prefer-hardware');
  });
});

describe('the ladder', () => {
  const events: DecoderEvents = {
    decoded: () => undefined,
    skipped: () => undefined,
    failed: () => undefined,
  };
  let supported: string[];

  beforeEach(() => {
    supported = ['prefer-hardware', 'no-preference', 'prefer-software'];
    vi.stubGlobal('EncodedVideoChunk', () => undefined);
    vi.stubGlobal(
      'VideoDecoder',
      class {
        static isConfigSupported({ hardwareAcceleration }: VideoDecoderConfig) {
          return Promise.resolve({ supported: supported.includes(hardwareAcceleration ?? '') });
        }
        configure(): void {
          // accepts everything
        }
      },
    );
  });

  const video = create(StreamConfigSchema, { codec: Codec.H264, codecString: 'avc1.42C01F' });
  const rung_after = async (first: DecoderRung, failures: number): Promise<string | undefined> =>
    (await make_decoder(video, first, failures, () => 0, new FakeTime(), events))?.rung;

  it('goes down a rung after two real failures, and begins where it ended', async () => {
    expect(await rung_after('prefer-hardware', 1)).toBe('prefer-hardware');
    expect(await rung_after('prefer-hardware', 2)).toBe('no-preference');
    expect(await rung_after('prefer-hardware', 4)).toBe('prefer-software');
    expect(await rung_after('prefer-hardware', 6)).toBeUndefined();
    expect(await rung_after('prefer-software', 0)).toBe('prefer-software');
    expect(await rung_after('prefer-software', 2)).toBeUndefined();
  });

  it('leaves out what the browser does not offer', async () => {
    supported = ['no-preference', 'prefer-software'];
    expect(await rung_after('prefer-hardware', 0)).toBe('no-preference');
    expect(await rung_after('prefer-hardware', 2)).toBe('prefer-software');
  });

  it('leaves out what the browser cannot be asked for, or never answers', async () => {
    vi.spyOn(console, 'warn').mockImplementation(() => undefined);
    const time = new FakeTime();
    vi.stubGlobal('VideoDecoder', {
      isConfigSupported: ({ hardwareAcceleration }: VideoDecoderConfig) =>
        hardwareAcceleration === 'prefer-hardware'
          ? new Promise(() => undefined)
          : Promise.reject(new TypeError('invalid')),
    });
    const made = make_decoder(video, 'prefer-hardware', 0, () => 0, time, events);
    for (let i = 0; i < 3; ++i) time.advance(1000);
    expect(await made).toBeUndefined();
    vi.restoreAllMocks();
  });

  it('asks for JPEG alone at its end, and without WebCodecs', () => {
    expect(available_codecs('prefer-hardware')).toEqual([Codec.H264, Codec.MJPEG]);
    expect(available_codecs('jpeg')).toEqual([Codec.MJPEG]);
    vi.unstubAllGlobals();
    expect(available_codecs('prefer-hardware')).toEqual([Codec.MJPEG]);
  });
});
