// The logic of the page.
import { readFileSync } from 'node:fs';
import { beforeEach, describe, expect, it } from 'vitest';
import { AutoHeight } from '#client/session/auto_height';
import { device_kind } from '#client/session/device';
import { frame_ms_of, QualityChoice } from '#client/session/quality';
import {
  leaves_scene_open,
  scene_address,
  scene_labels,
  scene_name,
  type SceneListing,
} from '#client/session/scenes';
import { AccessToken, has_token } from '#client/session/token';
import { endpoint_of } from '#client/transport/socket';
import { Settling } from '#client/ui/automation';
import { card_for, jpeg_reason, unsupported_card } from '#client/ui/wording';
import { Error_Code, Hello_Device } from '#client/wire/wire';
import { with_texts } from '../../web_client/page_texts';
import { FakeTime, fake_storage } from './fakes';

const listing = (id: string, title = id): SceneListing => ({ id, title, credits: '', licence: '' });

describe('access token', () => {
  it('moves from the fragment to the tab, and out of the address', () => {
    const storage = fake_storage();
    let shown = '';
    const history = {
      state: null,
      replaceState: (_state: unknown, _title: string, url?: string | URL | null) => {
        shown = String(url);
      },
    };
    const href = 'http://host/page?scene=city#token=a%2Bb&pose=1';
    expect(new AccessToken({ href }, history, storage).value).toBe('a+b');
    expect(shown).toBe('http://host/page?scene=city#pose=1');
    const next = new AccessToken({ href: 'http://host/page' }, history, storage);
    expect(next.value).toBe('a+b');
    next.value = 'typed';
    expect(new AccessToken({ href: 'http://host/page' }, history, storage).value).toBe('typed');
    const other = new AccessToken({ href: 'http://host/page#token=c' }, history, storage);
    expect(other.value).toBe('c');
    expect(shown).toBe('http://host/page');
  });

  it('is no text that servers close connections for, and the one before stays', () => {
    const storage = fake_storage();
    const history = { state: null, replaceState: () => undefined };
    const token_of = (text: string): string =>
      new AccessToken({ href: `http://host/#token=${encodeURIComponent(text)}` }, history, storage)
        .value;
    expect(token_of('a'.repeat(512))).toHaveLength(512);
    expect(token_of('good')).toBe('good');
    for (const text of [
      'a'.repeat(513),
      'é'.repeat(257),
      'a'.repeat(70_000),
      'a\nb',
      '\0',
      'a\x7f',
    ]) {
      expect(token_of(text)).toBe('good');
    }
  });

  it('is found in the fragment alone', () => {
    expect(has_token('http://host/?scene=city#at=1,2&token=x')).toBe(true);
    expect(has_token('http://host/#token')).toBe(true);
    for (const href of ['http://host/?token=x', 'http://host/#stop=1', 'http://host/'])
      expect(has_token(href)).toBe(false);
  });
});

describe('device', () => {
  it('follows from pointer, screen and headset browsers, and from nothing finer', () => {
    const kind = (user_agent: string, coarse_pointer: boolean, screen_px: number): Hello_Device =>
      device_kind({ user_agent, coarse_pointer, screen_px });
    expect(kind('Mozilla/5.0 (X11; Linux x86_64)', false, 1080)).toBe(Hello_Device.DESKTOP);
    expect(kind('Mozilla/5.0 (Linux; Android 15)', true, 390)).toBe(Hello_Device.PHONE);
    expect(kind('Mozilla/5.0 (iPad)', true, 820)).toBe(Hello_Device.TABLET);
    expect(kind('Mozilla/5.0 (Linux; Android 12; Quest 3) OculusBrowser/33', true, 600)).toBe(
      Hello_Device.HEADSET,
    );
  });
});

describe('endpoint', () => {
  it.each([
    ['http://127.0.0.1:8080/', 'ws://127.0.0.1:8080/'],
    ['https://host/tour/?scene=city#token=secret', 'wss://host/tour/'],
    ['https://host/tour/index.html?x#y', 'wss://host/tour/'],
  ])('of %s is %s', (page, endpoint) => {
    expect(endpoint_of(page)).toBe(endpoint);
  });
});

describe('scene address', () => {
  it('is the page with another scene, and nothing else changed', () => {
    const page = 'http://host/tour/?scene=nope&lang=en';
    expect(scene_address(page, 'a b&c')).toBe('http://host/tour/?scene=a+b%26c&lang=en');
    expect(scene_address('http://host/', 'city')).toBe('http://host/?scene=city');
    expect(scene_address('http://host/?scene=x&ui=0#at=1')).toBe('http://host/?ui=0');
  });
});

describe('names of scenes', () => {
  it('are their ids without digests', () => {
    expect(scene_name('hall-kdfmqrtv')).toBe('hall');
    for (const id of [
      'city',
      'scan-20240131',
      'hall-building',
      'hall-2',
      '-kdfmqrtv',
      'hall-KDFMQRTV',
      '',
    ]) {
      expect(scene_name(id)).toBe(id);
    }
  });

  it('say in a list which of several of a name it is', () => {
    const listed = [
      listing('hall-kdfmqrtv', 'hall'),
      listing('attic-bbcdnpvv', 'attic'),
      listing('hall-bbcdnpvv', 'hall'),
    ];
    expect(scene_labels(listed)).toEqual(['hall-kdfmqrtv', 'attic', 'hall-bbcdnpvv']);
  });

  it('are asked for where the address names neither a scene nor a view', () => {
    for (const rest of ['', '?author', '#token=a', '?scene=', '#mode=fly'])
      expect(leaves_scene_open(`http://host/${rest}`)).toBe(true);
    for (const rest of ['?scene=hall', '?ui=0', '#at=1', '#mode=fly&stop=2', '#watch=abc'])
      expect(leaves_scene_open(`http://host/${rest}`)).toBe(false);
  });
});

describe('automatic height', () => {
  it('suits the slower one of server and device', () => {
    expect(frame_ms_of({ render: 10, encode: 5, present: 12 })).toBe(15);
    expect(frame_ms_of({ render: 2, encode: 3, present: 117 })).toBeCloseTo(100, 0);
    expect(frame_ms_of({ render: NaN, encode: NaN, present: NaN })).toBeNaN(); // no frame came
  });

  const look_often = (auto: AutoHeight, frame_ms: number, view_px = 1080): number[] => {
    const heights = [];
    for (let i = 0; i < 12; ++i) {
      if (auto.look(frame_ms, view_px)) heights.push(auto.height_px(view_px));
    }
    return heights;
  };

  it('never exceeds the view', () => {
    const auto = new AutoHeight();
    expect(auto.height_px(360)).toBe(360);
    look_often(auto, 1);
    expect(auto.height_px(360)).toBe(360);
  });

  it('shrinks at once to what the server can keep up with, and only after several looks', () => {
    const auto = new AutoHeight();
    expect(auto.look(170, 1080)).toBe(false);
    expect(auto.look(170, 1080)).toBe(false);
    expect(auto.look(170, 1080)).toBe(true);
    // A quarter of the pixels: 720 / 2.
    expect(auto.height_px(1080)).toBe(300);
  });

  it('grows step by step while there is room', () => {
    expect(look_often(new AutoHeight(), 5)).toEqual([900, 1080]);
  });

  it('stays where it is when a frame takes what it may, or when there is none', () => {
    expect(look_often(new AutoHeight(), 40)).toEqual([]);
    expect(look_often(new AutoHeight(), NaN)).toEqual([]);
  });

  it('is that of pictures in motion: what rests has the size of the view, or the chosen one', () => {
    const quality = new QualityChoice();
    for (let i = 0; i < 12; ++i) quality.look(400, 1080);
    expect(quality.in_view(1080)).toMatchObject({ height_px: 240, still_height_px: 0 });
    quality.choose(480, 0);
    expect(quality.in_view(1080)).toMatchObject({ height_px: 480, still_height_px: 480 });
  });

  it('forgets a vote that is followed by another opinion', () => {
    const auto = new AutoHeight();
    for (let i = 0; i < 10; ++i) {
      expect(auto.look(170, 1080)).toBe(false);
      expect(auto.look(40, 1080)).toBe(false);
    }
  });
});

describe('settling', () => {
  const time = new FakeTime();
  let current: boolean;
  let settling: Settling;
  let settled: boolean;
  const after = async (ms: number): Promise<boolean> => {
    time.advance(ms);
    await Promise.resolve();
    await Promise.resolve();
    return settled;
  };

  beforeEach(() => {
    current = settled = false;
    settling = new Settling(() => current, time, time);
    void settling.wait().then(() => {
      settled = true;
    });
    time.advance(1);
    settling.presented();
  });

  it('waits for the newest pose and for the last refinement', async () => {
    expect(await after(5000)).toBe(false);
    current = true;
    settling.presented();
    time.advance(1);
    settling.presented();
    expect(await after(390)).toBe(false);
    settling.presented(); // a refinement begins the wait anew
    expect(await after(1500)).toBe(false);
    expect(await after(100)).toBe(true);
  });

  it('needs no further picture when the camera is known to rest only after the last one', async () => {
    expect(await after(100)).toBe(false);
    current = true;
    expect(await after(1000)).toBe(true);
  });
});

describe('wording', () => {
  it('says nothing over a live picture', () => {
    expect(card_for({ phase: 'live' }, true)).toBeUndefined();
    expect(card_for({ phase: 'live' }, false)?.busy).toBe(true);
  });

  it('has a title and a way on for every refusal', () => {
    const codes = Object.values(Error_Code).filter((code) => typeof code === 'number');
    for (const code of codes) {
      const card = card_for({ phase: 'failed', code, message: 'because' }, false);
      expect(card?.title).toBeTruthy();
      expect(card?.text).toContain('Because.');
      expect(card?.action ?? card?.asks_token, Error_Code[code]).toBeTruthy();
    }
  });

  it('tells what happened and when it tries again', () => {
    const card = card_for(
      { phase: 'waiting', cause: 'unreachable', retry_in_ms: 3000, message: '' },
      true,
    );
    expect(card).toMatchObject({
      time: expect.stringContaining('in 3 seconds') as unknown,
      action: { does: 'retry' },
    });
    expect(card?.title).toContain('does not answer');
  });

  it('offers the scenes that there are, and without any says where the name is', () => {
    const state = { phase: 'failed', code: Error_Code.UNKNOWN_SCENE, message: 'no' } as const;
    const scenes = [listing('city'), listing('hall')];
    expect(card_for(state, false, scenes)?.scenes).toEqual(scenes);
    expect(card_for(state, false, [listing('city')])?.action).toEqual({
      label: 'Open city',
      does: 'open',
      scene_id: 'city',
    });
    expect(card_for(state, false)?.text).toContain('?scene=');
    expect(card_for(state, false)?.action).toMatchObject({ does: 'open', scene_id: '' });
  });

  it('leaves a refused token to the words of the server', () => {
    const message = 'this server needs an access token: open the link you were given';
    const state = { phase: 'failed', code: Error_Code.UNAUTHORIZED, message } as const;
    expect(card_for(state, false)?.text).toBe(`T${message.slice(1)}.`);
    expect(card_for(state, false)?.action).toBeUndefined();
  });

  it('offers those whose link is refused to look without its token', () => {
    const state = {
      phase: 'failed',
      code: Error_Code.UNAUTHORIZED,
      message: 'this link has expired',
    } as const;
    expect(card_for(state, false, [], true)).toMatchObject({
      asks_token: true,
      action: { does: 'look' },
    });
    const kept = new Map<string, string>();
    const storage = {
      getItem: (key: string) => kept.get(key) ?? null,
      setItem: (key: string, text: string) => kept.set(key, text),
    };
    const opened = (href: string): AccessToken =>
      new AccessToken(
        { href },
        { state: null, replaceState: () => undefined },
        storage as unknown as Storage,
      );
    const token = opened('http://host/?author#token=old');
    token.set_aside();
    expect(token.value).toBe('');
    expect(opened('http://host/?author').value).toBe('old'); // a reload has it again
  });

  it('explains JPEG by what is missing', () => {
    expect(jpeg_reason(true, true, 'prefer-hardware')).toBeUndefined();
    expect(jpeg_reason(false, false, 'prefer-hardware')).toBe('not_secure');
    expect(jpeg_reason(false, true, 'prefer-hardware')).toBe('no_decoder');
    expect(jpeg_reason(true, true, 'jpeg')).toBe('failed_recently');
  });

  it('names what an old browser lacks', () => {
    const scope = { Worker: globalThis.Object as never, WebSocket: globalThis.Object as never };
    expect(unsupported_card(scope)?.text).toContain('OffscreenCanvas');
  });
});

describe('the texts of the page', () => {
  const index = readFileSync(new URL('../../web_client/index.html', import.meta.url), 'utf8');

  it('are in files of their own, and index.html names them', () => {
    const body = index.slice(index.indexOf('<main'));
    const attributes = [...body.matchAll(/ (?:aria-label|title|placeholder|alt)="([^"]*)"/g)];
    const between = [...body.matchAll(/>([^<]+)</g)];
    const texts = [...attributes, ...between].map(([, found]) => found!.trim());
    expect(texts.length).toBeGreaterThan(60);
    // Signs are no texts, such as the cross of a button or the comma between two keys.
    const loose = texts.filter((found) =>
      /[a-z]{2}/i.test(found.replace(/\{\{[\w.]+\}\}|&#\d+;/g, '')),
    );
    expect(loose).toEqual([]);
  });

  it('come into the page when it is built', () => {
    expect(with_texts('<p title="{{page.start_key}}">{{modes.orbit}}</p>')).toBe(
      '<p title="Back to the start (R)" data-title="page.start_key" data-text="modes.orbit">Orbit</p>',
    );
    expect(with_texts(index)).not.toContain('{{');
    expect(() => with_texts('<p>{{page.absent}}</p>')).toThrow('no text is called page.absent');
    expect(() => with_texts('<p>{{share}}</p>')).toThrow('no text is called share');
    expect(() => with_texts('<p>{{modes.orbit}} <b></b></p>')).toThrow(
      '{{modes.orbit}} is not the whole text of an element',
    );
  });
});
