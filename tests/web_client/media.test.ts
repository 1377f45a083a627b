// Pictures, films and sounds of tours: as they are written, and as they are heard.
import { readFileSync } from 'node:fs';
import { describe, expect, it } from 'vitest';
import type { Vec3 } from '#client/base/vector';
import { MediaAddresses } from '#client/media/addresses';
import { free_name, other_format } from '#client/media/media_folder';
import { Sounds, type Playable } from '#client/media/sounds';
import * as limits from '#client/tour/limits';
import { accepted, kind_of, media_kinds } from '#client/tour/media';
import {
  has_media,
  read_tours,
  tours_for,
  write_tours,
  type Stop,
  type Tour,
} from '#client/tour/tour';
import { fake_storage } from './fakes';

const up: Vec3 = [0, -1, 0];
const place = { position: [0, 0, 0], orientation: [0, 0, 0, 1] };
const read = (stop: object, tour: object = {}): Tour =>
  read_tours([{ ...tour, stops: [{ ...place, ...stop }] }], up, 1)[0]!;
const stop_of = (stop: object): Stop => read(stop).stops[0]!;
const source = (file: string): string =>
  readFileSync(new URL(`../../${file}`, import.meta.url), 'utf8');

describe('media of a sidecar', () => {
  const media = [
    { src: 'door.jpg', alt: 'A door', translations: { de: { alt: 'Eine Tür' } } },
    { src: 'film.mp4', captions: 'film.vtt' },
    { src: 'https://media.example/sea?x', type: 'audio' },
  ];

  it('are read, and written as they were', () => {
    const tour = read(
      { media, narration: { src: 'a.mp3', captions: 'a.vtt' } },
      { sound: { src: 'sea.ogg', volume: 0.2 } },
    );
    expect(tour.sound).toMatchObject({ src: 'sea.ogg', volume: 0.2 });
    const [stop] = tour.stops;
    expect(stop!.narration).toMatchObject({ src: 'a.mp3', captions: 'a.vtt' });
    expect(stop!.media!.map(({ kind, alt, captions }) => [kind, alt, captions])).toEqual([
      ['image', 'A door', ''],
      ['video', '', 'film.vtt'],
      ['audio', '', ''],
    ]);
    const [written] = write_tours([tour]) as {
      sound: object;
      stops: { media: object; narration: object }[];
    }[];
    expect(written!.stops[0]!.media).toEqual(media);
    expect(written!.stops[0]!.narration).toEqual({ src: 'a.mp3', captions: 'a.vtt' });
    expect(written!.sound).toEqual({ src: 'sea.ogg', volume: 0.2 });
    expect(has_media(tour)).toBe(true);
    expect(has_media(read({}))).toBe(false);
    expect(write_tours([read({})])).toEqual([
      { title: '', stops: [expect.not.objectContaining({ media: expect.anything() as unknown })] },
    ]);
  });

  it('describe pictures in the language of the visitor', () => {
    const alt_for = (...readers: string[]): unknown =>
      tours_for([read({ media })], readers)[0]!.stops[0]!.media![0];
    expect(alt_for('de-CH')).toMatchObject({ alt: 'Eine Tür', language: 'de' });
    expect(alt_for('fr')).toMatchObject({ alt: 'A door', language: '' });
  });

  it('are heard and captioned in the language of the visitor, part by part', () => {
    const narration = {
      src: 'a.mp3',
      captions: 'a.vtt',
      translations: {
        de: { src: 'https://media.example/de', type: 'audio' },
        fr: { captions: 'f.vtt' },
      },
    };
    const sound = { src: 'sea.ogg', translations: { de: { src: 'meer.ogg' } } };
    const film = {
      src: 'film.mp4',
      captions: 'film.vtt',
      translations: { de: { captions: 'd.vtt' } },
    };
    const tour = read({ media: [film], narration }, { sound });
    const for_reader = (reader: string): unknown[] => {
      const [shown] = tours_for([tour], [reader]);
      const [{ narration: voice, media: shows }] = shown!.stops as [Stop];
      return [voice!.src, voice!.captions, shown!.sound!.src, shows![0]!.captions];
    };
    expect(for_reader('de-AT')).toEqual(['https://media.example/de', 'a.vtt', 'meer.ogg', 'd.vtt']);
    expect(for_reader('fr')).toEqual(['a.mp3', 'f.vtt', 'sea.ogg', 'film.vtt']);
    expect(for_reader('ja')).toEqual(['a.mp3', 'a.vtt', 'sea.ogg', 'film.vtt']);
    const [written] = write_tours([tour]) as { sound: object; stops: object[] }[];
    expect(written!.sound).toEqual(sound);
    expect(written!.stops[0]).toMatchObject({ narration, media: [film] });
  });

  it.each([
    [{ media: {} }, 'tours[0].stops[0].media: is not a list'],
    [{ media: [{ alt: 'x' }] }, "media[0]: 'src' is missing"],
    [{ media: [{ src: 'a.jpg' }] }, "media[0]: 'alt' is missing"],
    [{ media: [{ src: '../a.jpg', alt: 'x' }] }, 'media[0].src: is not the name of a file'],
    [{ media: [{ src: 'a/b.jpg', alt: 'x' }] }, 'media[0].src: is not the name of a file'],
    [
      { media: [{ src: 'http://media.example/a.jpg', alt: 'x' }] },
      'media[0].src: is not the name of a file',
    ],
    [{ media: [{ src: 'javascript:alert(1)//a.mp4' }] }, 'media[0].src: is not the name of a file'],
    [{ media: [{ src: 'a.svg', alt: 'x' }] }, 'media[0].src: is not an image, video or audio'],
    [{ media: [{ src: 'a.mp4', type: 'page' }] }, 'media[0].type: is not an image, video or audio'],
    [{ media: [{ src: 'a.mp4', captions: 'a.html' }] }, 'captions: is not the name of a .vtt file'],
    [
      { media: [{ src: 'a.mp4', captions: 'https://x.example/a.vtt' }] },
      'captions: is not the name of a .vtt file',
    ],
    [{ media: Array.from({ length: 9 }, () => ({ src: 'a.mp3' })) }, 'has 9 entries, at most 8'],
    [{ narration: { src: 'a.mp4' } }, 'narration.src: is not a sound'],
    [
      { narration: { src: 'a.mp3', translations: { de: { src: 'a.mp4' } } } },
      'narration.translations.de.src: is not a sound',
    ],
  ])('are refused by the field that is wrong: %j', (stop, complaint) => {
    expect(() => stop_of(stop)).toThrow(complaint);
  });

  it('have the limits and the formats of the server', () => {
    const types = source('render_core/scene/files/media_name.cpp');
    const known = [...types.matchAll(/\{"(\w+)", &\w+\}/g)].map(([, extension]) => `.${extension}`);
    expect(
      accepted([...media_kinds, 'captions'])
        .split(',')
        .sort(),
    ).toEqual(known.sort());
    expect(source('server/media/media_type.h')).toContain(
      `max_media_bytes = ${limits.max_media_bytes >> 20} << 20`,
    );
    expect(source('render_core/scene/files/tour_check.cpp')).toContain(
      `max_media = ${limits.max_media};`,
    );
    expect([kind_of('a.JPG'), kind_of('a.jpg?x=.mp4'), kind_of('a.svg'), kind_of('mp4')]).toEqual([
      'image',
      'image',
      undefined,
      undefined,
    ]);
  });
});

describe('a file that an author sends', () => {
  it.each([
    ['Door.JPG', [], 'Door.jpg'],
    ['The old door (1904).jpeg', [], 'The-old-door-1904.jpeg'],
    ['Tür.png', [], 'Tur.png'],
    ['../../etc/passwd', [], 'file.etc-passwd'],
    ['.hidden.png', [], 'hidden.png'],
    ['門.png', [], 'file.png'],
    ['door.jpg', ['DOOR.jpg', 'door-2.jpg'], 'door-3.jpg'],
    [`${'x'.repeat(200)}.webp`, [], `${'x'.repeat(80)}.webp`],
  ])('%s gets a name that the server takes and no other file has', (wanted, taken, name) => {
    expect(free_name(wanted, taken)).toBe(name);
    expect(free_name(wanted, taken)).toMatch(/^[\w-][\w.-]{0,99}$/);
  });
});

describe('sounds', () => {
  class Element implements Playable {
    src = '';
    volume = 1;
    muted = false;
    plays = false;
    refuses = false;
    play(): Promise<void> {
      if (this.refuses)
        return Promise.reject(Object.assign(new Error('x'), { name: 'NotAllowedError' }));
      this.plays = true;
      return Promise.resolve();
    }
    pause(): void {
      this.plays = false;
    }
  }

  function make(touched = true, storage = fake_storage()) {
    const [voice, background] = [new Element(), new Element()];
    const sounds = new Sounds({ voice, background, touched, storage, changed: () => undefined });
    return { sounds, voice, background };
  }

  it('begin with the first touch of the visitor', () => {
    const { sounds, voice, background } = make(false);
    sounds.set_background('sea.ogg', 0.4);
    sounds.speak('a.mp3');
    expect([voice.plays, background.plays, sounds.audible]).toEqual([false, false, false]);
    let heard = false;
    sounds.when_heard(() => (heard = true));
    expect(heard).toBe(true); // a tour continues without what nobody hears
    sounds.touch();
    expect([voice.plays, background.plays, sounds.audible]).toEqual([true, true, true]);
  });

  it('wait for another touch where the browser refuses', async () => {
    const { sounds, voice, background } = make();
    voice.refuses = background.refuses = true;
    sounds.set_background('sea.ogg', 0.4);
    sounds.speak('a.mp3');
    await Promise.resolve();
    await Promise.resolve();
    expect(sounds.audible).toBe(false);
    voice.refuses = background.refuses = false;
    sounds.touch();
    expect([voice.plays, background.plays]).toEqual([true, true]);
  });

  it('of the tour are quiet while a voice speaks or a film plays', () => {
    const { sounds, voice, background } = make();
    sounds.set_background('sea.ogg', 0.4);
    expect([background.volume, background.plays]).toEqual([0.4, true]);
    sounds.speak('a.mp3');
    expect(background.volume).toBeCloseTo(0.1);
    sounds.voice_ended();
    expect(background.volume).toBe(0.4);
    sounds.resume();
    sounds.film(true);
    expect([voice.plays, sounds.voice, background.volume < 0.2]).toEqual([false, 'paused', true]);
    sounds.film(false);
    expect(background.volume).toBe(0.4);
    sounds.set_background('', 0);
    expect(background.plays).toBe(false);
  });

  it('are muted by one button, which remembers', () => {
    const storage = fake_storage();
    const { sounds, voice, background } = make(true, storage);
    sounds.set_background('sea.ogg', 0.4);
    sounds.speak('a.mp3');
    sounds.toggle();
    expect([sounds.muted, voice.muted, background.plays]).toEqual([true, true, false]);
    expect(voice.plays).toBe(true); // its words go on, as text
    expect(make(true, storage).sounds.audible).toBe(false);
    sounds.toggle();
    expect([voice.muted, background.plays]).toEqual([false, true]);
    expect(make(true, storage).sounds.audible).toBe(true);
  });

  it('come on by the button that says so, also before any other touch', () => {
    const { sounds, voice } = make(false);
    sounds.speak('a.mp3');
    sounds.toggle();
    expect([sounds.audible, voice.plays, voice.muted]).toEqual([true, true, false]);
  });

  it('rest while the page is hidden, and a tour waits for them', () => {
    const { sounds, voice, background } = make();
    sounds.set_background('sea.ogg', 0.4);
    sounds.speak('a.mp3');
    let heard = 0;
    sounds.when_heard(() => ++heard);
    const cancel = sounds.when_heard(() => (heard += 10));
    cancel();
    sounds.hide(true);
    expect([voice.plays, background.plays, heard]).toEqual([false, false, 0]);
    sounds.hide(false);
    expect([voice.plays, background.plays]).toEqual([true, true]);
    sounds.voice_ended();
    expect(heard).toBe(1);
  });

  it('of one stop do not go on at the next', () => {
    const { sounds, voice } = make();
    sounds.speak('a.mp3');
    sounds.hush();
    sounds.resume();
    expect([voice.plays, sounds.voice]).toEqual([false, 'none']);
  });
});

it('names the formats of cameras that tours cannot show', async () => {
  const format_of = (head: string) => other_format(new Blob([head]));
  for (const brand of ['heic', 'heix', 'mif1'])
    expect(await format_of(`\0\0\0\x18ftyp${brand}`)).toEqual({ format: 'HEIC', instead: 'JPEG' });
  expect(await format_of('\0\0\0\x14ftypqt  ')).toEqual({ format: 'QuickTime', instead: 'MP4' });
  for (const head of ['\0\0\0\x18ftypisom', '\x89PNG', '', 'heic'])
    expect(await format_of(head)).toBeUndefined();
});

it('addresses of media carry the newest pass of a spectator', async () => {
  const token = { value: '', pass: 'first' };
  const addresses = new MediaAddresses('https://tours.example/', token, 'hall');
  const pass = async () => new URL(await addresses.of('door.jpg')).searchParams.get('pass');
  expect(await pass()).toBe('first');
  token.pass = 'second';
  expect(await pass()).toBe('second');
});
