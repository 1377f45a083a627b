import { beforeEach, describe, expect, it } from 'vitest';
import { backoff_ms } from '#client/session/backoff';
import { greeting_ms, silence_ms } from '#client/session/link';
import type { Session } from '#client/session/session';
import type { SessionState } from '#client/session/state';
import { card_for } from '#client/ui/wording';
import { Codec, Error_Code } from '#client/wire/wire';
import { FakeSession, type FakeSocket, type FakeTime } from './fakes';

const pose = (id: bigint) => ({
  poseId: id,
  clientTimeUs: id * 1000n,
  worldFromCamera: { position: { x: Number(id) }, orientation: { w: 1 } },
  fovYRad: 1,
});

let fake: FakeSession;
let time: FakeTime;
let sockets: FakeSocket[];
let session: Session;
let frames: bigint[];
let configs: string[];
let notices: string[];
let stayed: string[];
let streams_ended: number;

beforeEach(() => {
  frames = [];
  configs = [];
  stayed = [];
  streams_ended = 0;
  fake = new FakeSession({
    config: (config) => configs.push(config.encoder),
    frame: (header) => frames.push(header.frameId),
    stream_ended: () => {
      streams_ended += 1;
      session.send({ case: 'ack', value: { frameId: 99n } });
    },
    stayed: (message) => stayed.push(message),
  });
  ({ time, sockets, session, notices } = fake);
});

const last_state = (): SessionState | undefined => fake.last_state;
const socket = (i: number): FakeSocket => fake.socket(i);
const poses = (of: FakeSocket): bigint[] => of.sent('pose').map(({ poseId }) => poseId);

function welcome(to: FakeSocket, encoder = 'x264'): void {
  to.events.opened();
  to.say({ case: 'welcome', value: { version: 1, resumeToken: 'again', config: { encoder } } });
}

function go_live(): FakeSocket {
  session.start();
  welcome(socket(0));
  return socket(0);
}

describe('greeting', () => {
  it('says hello first, and nothing else before the welcome', () => {
    session.start();
    session.send_pose(pose(1n));
    session.send({ case: 'requestIdr', value: {} });
    expect(last_state()).toEqual({ phase: 'connecting', attempt: 0 });
    socket(0).events.opened();
    expect(socket(0).heard.map((body) => body.case)).toEqual(['hello']);
    expect(socket(0).sent('hello')[0]).toMatchObject({
      version: 1,
      sceneId: 'city',
      token: 'secret',
      decoders: [Codec.H264],
    });
    socket(0).say({ case: 'welcome', value: { config: { encoder: 'x264' } } });
    expect(last_state()).toEqual({ phase: 'live' });
    expect(configs).toEqual(['x264']);
    expect(poses(socket(0))).toEqual([1n]);
  });

  it('shows the queue while it waits for its turn', () => {
    session.start();
    socket(0).events.opened();
    socket(0).say({ case: 'queue', value: { position: 3, estimateS: 40 } });
    const waiting: SessionState = {
      phase: 'queued',
      position: 3,
      estimate_s: 40,
      for_scene: false,
    };
    expect(last_state()).toEqual(waiting);
    socket(0).say({ case: 'queue', value: { position: 1, estimateS: 9, forScene: true } });
    const loading: SessionState = { phase: 'queued', position: 1, estimate_s: 9, for_scene: true };
    expect(last_state()).toEqual(loading);
    expect(card_for(loading, false)?.title).toBe('Loading the scene');
    expect(card_for(waiting, false)?.title).toContain('Number 3');
  });

  it('gives up a server that accepts and says nothing', () => {
    session.start();
    socket(0).events.opened();
    time.advance(greeting_ms - 1);
    expect(last_state()?.phase).toBe('connecting');
    time.advance(1);
    expect(last_state()).toMatchObject({ phase: 'waiting', cause: 'silent' });
    expect(socket(0).closed).toBe(true);
  });
});

describe('a visitor who leaves', () => {
  const cases = (i: number): unknown[] => socket(i).heard.map((body) => body.case);

  it('says so wherever the session stands, and no connection is left', () => {
    session.start();
    socket(0).events.opened(); // in the queue
    session.stop();
    session.retry();
    welcome(socket(1));
    socket(1).say({ case: 'drain', value: {} });
    welcome(socket(2), 'of the next server');
    session.stop();
    for (const i of [0, 1, 2]) expect(cases(i)).toContain('bye');
    expect(sockets.map(({ closed }) => closed)).toEqual([true, true, true]);
    time.advance(60_000);
    expect(sockets).toHaveLength(3);
  });

  it('continues where they were when the page comes back', () => {
    go_live();
    session.send_pose(pose(7n));
    session.keep({ case: 'clip', value: { offset: 2 } });
    session.stop();
    session.retry();
    welcome(socket(1));
    expect(socket(1).sent('hello')[0]).toMatchObject({
      sceneId: 'city',
      resume: { token: 'again', pose: { poseId: 7n } },
    });
    expect(socket(1).sent('clip')).toMatchObject([{ offset: 2 }]);
    expect(last_state()).toEqual({ phase: 'live' });
  });
});

describe('reconnecting', () => {
  it('follows a closed connection, with the same pose and the resume token', () => {
    const first = go_live();
    session.send_pose(pose(7n));
    first.events.closed(1006, '');
    expect(last_state()).toMatchObject({ phase: 'waiting', cause: 'lost' });
    time.advance(backoff_ms(1, () => 0.5));
    socket(1).events.opened();
    expect(socket(1).sent('hello')[0]?.resume).toMatchObject({
      token: 'again',
      pose: { poseId: 7n },
    });
    socket(1).say({ case: 'welcome', value: {} });
    expect(poses(socket(1))).toEqual([7n]);
    expect(last_state()).toEqual({ phase: 'live' });
  });

  it.each([
    ['what is left of it', 2.5, [2, 3, 30]],
    ['nothing once it is over', 31, undefined],
  ])('tells the next server of the path that a tour takes: %s', (_name, after_s, left_s) => {
    const first = go_live();
    const path = [0, 1, 2, 3, 30].map((s) => ({ poseId: 0n, clientTimeUs: BigInt(s * 1e6) }));
    session.send_path(path);
    const beat = 2000; // ms
    for (let ms = 0; ms < after_s * 1000; ms += beat) {
      time.advance(Math.min(beat, after_s * 1000 - ms));
      first.say({ case: 'heartbeat', value: {} });
    }
    first.events.closed(1006, '');
    session.retry();
    socket(1).events.opened();
    const resume = socket(1).sent('hello')[0]!.resume!;
    expect(resume.path?.samples.map(({ clientTimeUs }) => Number(clientTimeUs) / 1e6)).toEqual(
      left_s,
    );
  });

  it('follows silence, but not a server that has a heartbeat', () => {
    const first = go_live();
    for (let i = 0; i < 10; ++i) {
      time.advance(silence_ms - 1);
      first.say({ case: 'heartbeat', value: {} });
    }
    expect(last_state()).toEqual({ phase: 'live' });
    time.advance(silence_ms);
    expect(last_state()).toMatchObject({ phase: 'waiting', cause: 'silent' });
    expect(first.closed).toBe(true);
  });

  it('waits longer each time, up to a limit', () => {
    session.start();
    const waits = [];
    for (let i = 0; i < 8; ++i) {
      socket(i).events.closed(1006, '');
      const state = last_state();
      if (state?.phase !== 'waiting') throw new Error(`phase ${String(state?.phase)}`);
      expect(state.cause).toBe('unreachable');
      waits.push(state.retry_in_ms);
      time.advance(state.retry_in_ms);
    }
    expect(waits).toEqual([375, 750, 1500, 3000, 6000, 7500, 7500, 7500]);
  });

  it('does not hurry back to a server that drops it after each welcome', () => {
    const first = go_live();
    first.events.closed(1006, '');
    time.advance(375);
    welcome(socket(1));
    socket(1).events.closed(1006, '');
    expect(last_state()).toMatchObject({ retry_in_ms: 750 });
    time.advance(750);
    welcome(socket(2));
    for (let i = 0; i < 5; ++i) {
      time.advance(1000);
      socket(2).say({ case: 'heartbeat', value: {} });
    }
    socket(2).events.closed(1006, '');
    expect(last_state()).toMatchObject({ retry_in_ms: 375 });
  });

  it('happens at once when asked for, and only once', () => {
    const first = go_live();
    first.events.closed(1006, '');
    session.retry();
    expect(sockets).toHaveLength(2);
    welcome(socket(1));
    time.advance(2000);
    socket(1).say({ case: 'heartbeat', value: {} });
    time.advance(2000);
    expect(sockets).toHaveLength(2);
  });

  it('treats a message that breaks the contract as a lost connection', () => {
    const first = go_live();
    first.events.message(new Uint8Array([2, 0xff]).buffer);
    expect(first.closed).toBe(true);
    expect(last_state()).toMatchObject({ phase: 'waiting', cause: 'lost' });
  });
});

describe('errors', () => {
  it.each([Error_Code.SERVER_FULL, Error_Code.RATE_LIMITED, Error_Code.INTERNAL])(
    'tries again after code %i',
    (code) => {
      session.start();
      socket(0).events.opened();
      socket(0).say({ case: 'error', value: { code, message: 'why', fatal: true } });
      expect(last_state()).toMatchObject({ phase: 'waiting', cause: 'refused', message: 'why' });
      time.advance(10_000);
      expect(sockets).toHaveLength(2);
    },
  );

  it('stops after a refusal that time does not cure, until something changes', () => {
    session.start();
    socket(0).events.opened();
    const value = { code: Error_Code.UNAUTHORIZED, message: 'bad token', fatal: true };
    socket(0).say({ case: 'error', value });
    time.advance(60_000);
    expect(sockets).toHaveLength(1);
    expect(last_state()).toEqual({
      phase: 'failed',
      code: Error_Code.UNAUTHORIZED,
      message: 'bad token',
    });
    session.greet_anew({ token: 'better' });
    socket(1).events.opened();
    expect(socket(1).sent('hello')[0]?.token).toBe('better');
  });

  it('passes on what is not fatal and continues', () => {
    const first = go_live();
    const value = { code: Error_Code.RATE_LIMITED, message: 'slow down', fatal: false };
    first.say({ case: 'error', value });
    expect(notices).toEqual(['slow down']);
    expect(last_state()).toEqual({ phase: 'live' });
  });
});

describe('drain', () => {
  it('shows the old connection until the new one has a picture', () => {
    const old = go_live();
    session.send_pose(pose(4n));
    old.say({ case: 'drain', value: { deadlineMs: 5000 } });
    welcome(socket(1), 'nvenc');
    expect(poses(socket(1))).toEqual([4n]);
    old.frame({ frameId: 10n });
    expect(old.closed).toBe(false);
    expect(configs).toEqual(['x264']);
    socket(1).frame({ frameId: 1n, idr: true });
    expect(old.closed).toBe(true);
    expect(old.sent('bye')).toHaveLength(1);
    expect(configs).toEqual(['x264', 'nvenc']);
    expect(frames).toEqual([10n, 1n]);
    // Frame numbers of the old connection mean nothing to the new one.
    expect(streams_ended).toBe(1);
    expect(old.sent('ack')).toHaveLength(1);
    expect(socket(1).sent('ack')).toEqual([]);
    session.send_pose(pose(5n));
    expect(poses(socket(1))).toEqual([4n, 4n, 5n]);
  });

  it('tries again when the new connection fails, while the old one lives', () => {
    const old = go_live();
    old.say({ case: 'drain', value: {} });
    socket(1).events.closed(1006, '');
    expect(old.closed).toBe(false);
    expect(last_state()).toEqual({ phase: 'live' });
    time.advance(375);
    expect(sockets).toHaveLength(3);
  });

  it('tries less and less often where nobody else takes it', () => {
    const old = go_live();
    old.say({ case: 'drain', value: {} });
    for (let ms = 0, refused = 1; ms < 10_000; ms += 25) {
      for (; refused < sockets.length; refused += 1) socket(refused).events.closed(1006, '');
      time.advance(25);
    }
    expect(sockets.length).toBeGreaterThan(4);
    expect(sockets.length).toBeLessThan(8); // 28 with half a second between two
  });

  it('continues with the new connection when the old one ends first', () => {
    const old = go_live();
    session.send_pose(pose(4n));
    old.say({ case: 'drain', value: {} });
    old.events.closed(1001, '');
    expect(last_state()?.phase).toBe('connecting');
    welcome(socket(1));
    expect(last_state()).toEqual({ phase: 'live' });
    expect(poses(socket(1))).toEqual([4n]);
    expect(sockets).toHaveLength(2);
  });

  it('reconnects like after any loss when the new connection is lost as well', () => {
    const old = go_live();
    old.say({ case: 'drain', value: {} });
    old.events.closed(1001, '');
    socket(1).events.closed(1006, '');
    expect(last_state()).toMatchObject({ phase: 'waiting', cause: 'updating', message: '' });
  });

  it('says that the server is updated until one answers, and for five minutes at most', () => {
    const old = go_live();
    old.say({ case: 'drain', value: {} });
    for (const link of [0, 1]) socket(link).events.closed(1001, 'the server is shutting down');
    const title = (): string | undefined => {
      const state = last_state();
      return state && card_for(state, true)?.title;
    };
    expect(title()).toBe('The server is being updated');
    const lose_next = (): void => {
      while (last_state()?.phase === 'waiting') time.advance(100);
      sockets.at(-1)!.events.closed(1006, '');
    };
    lose_next();
    expect(title()).toBe('The server is being updated');
    time.advance(300_000);
    lose_next();
    expect(title()).toBe('The server does not answer');
  });

  it('says so to those who come meanwhile, and no more once a server takes them', () => {
    session.start();
    socket(0).events.opened();
    socket(0).events.closed(1012, 'this server is shutting down');
    expect(last_state()).toMatchObject({ phase: 'waiting', cause: 'updating', message: '' });
    session.retry();
    welcome(socket(1));
    socket(1).events.closed(1006, '');
    expect(last_state()).toMatchObject({ phase: 'waiting', cause: 'lost' });
  });
});

describe('poses', () => {
  it('are skipped on a congested connection, except for the newest', () => {
    const first = go_live();
    first.buffered_bytes = 1e6;
    session.send_pose(pose(1n));
    session.send_pose(pose(2n));
    time.advance(100);
    expect(first.sent('pose')).toEqual([]);
    first.buffered_bytes = 0;
    time.advance(100);
    expect(poses(first)).toEqual([2n]);
  });

  it('are repeated now and then, but not for a hidden page', () => {
    const first = go_live();
    session.send_pose(pose(1n));
    const beat = (seconds: number): void => {
      for (let i = 0; i < seconds; ++i) {
        time.advance(1000);
        first.say({ case: 'heartbeat', value: {} });
      }
    };
    beat(25);
    expect(poses(first)).toEqual([1n, 1n, 1n]);
    session.set_paused(true);
    expect(first.sent('pause')).toMatchObject([{ paused: true }]);
    beat(25);
    expect(first.sent('pose')).toHaveLength(3);
  });
});

describe('backoff', () => {
  it('is jittered between half and all of its ceiling', () => {
    expect(backoff_ms(1, () => 0)).toBe(250);
    expect(backoff_ms(1, () => 1)).toBe(500);
    expect(backoff_ms(1000, () => 1)).toBe(10_000);
  });
});

describe('another scene', () => {
  it('is selected without a new connection, and greeted again after a loss', () => {
    const first = go_live();
    session.send_pose(pose(1n));
    session.select_scene('attic');
    expect(first.sent('selectScene')).toMatchObject([{ sceneId: 'attic' }]);
    first.say({ case: 'welcome', value: { config: { encoder: 'x264' } } });
    expect(first.sent('pose').length).toBe(1); // no pose of the scene that was left
    first.events.closed(1006, '');
    time.advance(10_000);
    socket(1).events.opened();
    const [hello] = socket(1).sent('hello');
    expect(hello).toMatchObject({ sceneId: 'attic' });
    expect(hello!.resume?.pose).toBeUndefined();
  });

  it('is not entered where the server refuses it', () => {
    const first = go_live();
    session.select_scene('vault');
    first.say({ case: 'error', value: { code: Error_Code.UNAUTHORIZED, message: 'not yours' } });
    expect(stayed).toEqual(['not yours']);
    expect(notices).toEqual([]);
    first.say({
      case: 'error',
      value: { code: Error_Code.UNAUTHORIZED, message: 'something else' },
    });
    expect(notices).toEqual(['something else']);
    first.events.closed(1006, '');
    time.advance(10_000);
    socket(1).events.opened();
    expect(socket(1).sent('hello')[0]).toMatchObject({ sceneId: 'city' });
  });
});
