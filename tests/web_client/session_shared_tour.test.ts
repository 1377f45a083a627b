// A session whose visitor watches or follows another one.
import { beforeEach, describe, expect, it } from 'vitest';
import { backoff_ms } from '#client/session/backoff';
import type { Session } from '#client/session/session';
import { Error_Code } from '#client/wire/wire';
import { FakeSession, type FakeSocket, type FakeTime } from './fakes';

const pose = {
  poseId: 1n,
  clientTimeUs: 1000n,
  worldFromCamera: { orientation: { w: 1 } },
  fovYRad: 1,
};
let fake: FakeSession;
let time: FakeTime;
let session: Session;
let notices: string[];
let hosts: string[];

beforeEach(() => {
  hosts = [];
  fake = new FakeSession({ lead: ({ name }) => hosts.push(name) });
  ({ time, session, notices } = fake);
});

const socket = (i: number): FakeSocket => fake.socket(i);
const cases = (i: number): unknown[] => socket(i).heard.map((body) => body.case);

/** The visitor has a session of its own. */
function go_live(): void {
  session.start();
  socket(0).events.opened();
  socket(0).say({ case: 'welcome', value: { resumeToken: 'again' } });
}

describe('a session in a shared tour', () => {
  it('watches where it has no place, and follows and leads on a stream of its own, also after a loss', () => {
    session.keep({ case: 'follow', value: { watch: 'w' } });
    session.greet_anew({ watch: 'w', follow: true });
    socket(0).events.opened();
    expect(socket(0).sent('hello')[0]).toMatchObject({ watch: 'w', follow: true });
    socket(0).say({ case: 'welcome', value: { watching: true } });
    session.send_pose(pose);
    expect(cases(0)).toEqual(['hello']);
    socket(0).say({ case: 'lead', value: { name: 'Ada' } });
    expect(hosts).toEqual(['Ada']);
    socket(0).say({
      case: 'error',
      value: { code: Error_Code.SESSION_ENDED, message: 'over', fatal: true },
    });
    expect(fake.last_state).toMatchObject({ phase: 'waiting', cause: 'no_host' });
    session.retry();
    socket(1).events.opened();
    expect(socket(1).sent('hello')[0]).toMatchObject({ watch: 'w' });
    socket(1).say({ case: 'welcome', value: { resumeToken: 'again' } });
    expect(cases(1)).toEqual(['hello', 'follow', 'pose']);
    session.keep({ case: 'present', value: { on: true, name: 'me' } });
    socket(1).events.closed(1006, '');
    session.retry();
    socket(2).events.opened();
    expect(socket(2).sent('hello')[0]).toMatchObject({ watch: '', follow: false });
    socket(2).say({ case: 'welcome', value: {} });
    expect(cases(2)).toEqual(['hello', 'follow', 'present', 'pose']);
  });

  it('goes along into another scene, and stays there after a loss', () => {
    session.keep({ case: 'follow', value: { watch: 'w' } });
    go_live();
    session.send_pose(pose);
    session.greet_anew({ watch: 'w', follow: true });
    socket(1).events.opened();
    expect(socket(1).sent('hello')[0]).toMatchObject({
      sceneId: 'city',
      watch: 'w',
      resume: { token: 'again' },
    });
    expect(socket(1).sent('hello')[0]!.resume!.pose).toBeUndefined(); // that was in the other scene
    socket(1).say({ case: 'welcome', value: { scene: { sceneId: 'park' } } });
    expect(cases(1)).toEqual(['hello', 'follow']);
    session.retry();
    socket(2).events.opened();
    expect(socket(2).sent('hello')[0]).toMatchObject({ sceneId: 'park', watch: '' });
  });

  it.each([
    ['into the scene that it watched, where it may', true, 'park'],
    ['into its own scene otherwise', false, 'city'],
  ])('leaves %s', (_name, mayLeave, sceneId) => {
    go_live();
    session.greet_anew({ watch: 'w', follow: true });
    socket(1).events.opened();
    socket(1).say({
      case: 'welcome',
      value: { watching: true, mayLeave, scene: { sceneId: 'park' } },
    });
    session.greet_anew({ watch: '' });
    socket(2).events.opened();
    expect(socket(2).sent('hello')[0]).toMatchObject({
      sceneId,
      watch: '',
      resume: { token: 'again' },
    });
  });

  it.each([
    ['where nobody leads after three tries', Error_Code.SESSION_ENDED, 3],
    ['where all places stay taken', Error_Code.SERVER_FULL, 3],
    ['at once where it may not watch', Error_Code.UNAUTHORIZED, 1],
    ['at once where it cannot decode the pictures', Error_Code.NO_COMMON_CODEC, 1],
  ])('has its own session back %s', (_name, code, tries) => {
    session.keep({ case: 'follow', value: { watch: 'w' } });
    go_live();
    session.greet_anew({ watch: 'w', follow: true });
    for (let i = 1; i <= tries; ++i) {
      socket(i).events.opened();
      expect(socket(i).sent('hello')[0]).toMatchObject({ watch: 'w', follow: true });
      expect(notices).toEqual([]);
      socket(i).say({ case: 'error', value: { code, message: 'why', fatal: true } });
      time.advance(backoff_ms(i, () => 0.5));
    }
    expect(notices).toEqual(['why']);
    const own = socket(tries + 1);
    own.events.opened();
    expect(own.sent('hello')[0]).toMatchObject({
      sceneId: 'city',
      watch: '',
      resume: { token: 'again' },
    });
    own.say({ case: 'welcome', value: {} });
    expect(cases(tries + 1)).toEqual(['hello']); // it would be led away again
    expect(fake.last_state).toEqual({ phase: 'live' });
  });

  it('keeps watching a host who enters one scene after the other', () => {
    go_live();
    session.greet_anew({ watch: 'w', follow: true });
    for (let i = 1; i < 8; ++i) {
      socket(i).events.opened();
      if (i % 2 === 1) socket(i).say({ case: 'welcome', value: { watching: true } });
      expect(socket(i).sent('hello')[0]).toMatchObject({ watch: 'w' });
      socket(i).say({
        case: 'error',
        value: { code: Error_Code.SESSION_ENDED, message: 'over', fatal: true },
      });
      time.advance(backoff_ms(2, () => 0.5));
    }
    expect(notices).toEqual([]);
  });
});
