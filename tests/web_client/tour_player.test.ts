// Leading a visitor through a tour.
import { describe, expect, it } from 'vitest';
import { identity } from '#client/base/vector';
import type { Eye } from '#client/camera/eye';
import type { Flight, PathSample } from '#client/camera/flight';
import type { Section } from '#client/camera/section';
import { TourPlayer, type TourState } from '#client/tour/player';
import type { Tour } from '#client/tour/tour';
import { untranslated } from '#client/tour/words';
import { expect_vec } from './cameras';
import { FakeTime } from './fakes';

describe('the player', () => {
  const stop = (x: number, caption = ''): Tour['stops'][number] => ({
    title: `at ${x}`,
    caption,
    ...untranslated,
    eye: { position: [x, 0, 0], orientation: identity, fov_y_rad: 1 },
    marker: undefined,
    stay_s: 2,
    fly_s: undefined,
    portal: undefined,
  });
  const tour: Tour = {
    title: 'a tour',
    ...untranslated,
    stops: [1, 2, 3].map((x) => stop(x)),
    way: undefined,
    starts_itself: false,
  };

  /** A camera that a test flies by hand. */
  function guided(reduced_motion = false) {
    const time = new FakeTime();
    let eye: Eye = { position: [0, 0, 0], orientation: identity, fov_y_rad: 1 };
    let flight: { way: Flight; ended: (arrived: boolean) => void } | undefined;
    const paths: (readonly PathSample[])[] = [];
    const reached: [number, number][] = [];
    const sections: (Section | undefined)[] = [];
    let state: TourState | undefined;
    let speaks = false;
    let heard: (() => void) | undefined;
    const stop_flight = (): void => {
      const stopped = flight;
      flight = undefined;
      stopped?.ended(false);
    };
    const player = new TourPlayer(
      {
        camera: {
          get eye() {
            return eye;
          },
          reach: 1,
          fly: (way, ended) => {
            stop_flight();
            flight = { way, ended };
          },
          stop_flight,
        },
        timers: time,
        now_us: () => time.now_us(),
        announce: (path) => paths.push(path),
        show_section: (section) => sections.push(section),
        reached: (tour_index, stop_index) => {
          expect(state?.stop_index).toBe(stop_index); // the page knows where the visitor is
          reached.push([tour_index, stop_index]);
        },
        when_heard: (then) => {
          heard = then;
          if (!speaks) then();
          return () => (heard = undefined);
        },
        reduced_motion,
      },
      (now) => (state = now),
    );
    return {
      player,
      time,
      paths,
      reached,
      sections,
      stop_flight,
      state: () => state!,
      speak: () => void (speaks = true),
      fall_silent: () => {
        speaks = false;
        heard?.();
      },
      flying: () => flight?.way,
      arrive: () => {
        const arrived = flight!;
        time.advance(arrived.way.duration_s * 1000);
        eye = arrived.way.at(arrived.way.duration_s);
        flight = undefined;
        arrived.ended(true);
        return eye.position[0];
      },
    };
  }

  it('shows what another visitor leads to, and leaves the camera to them', () => {
    const { player, time, arrive, flying, paths, reached, state } = guided();
    player.load([tour, { ...tour, title: 'another' }]);
    player.play();
    arrive();
    player.be_shown(1, 2);
    expect(state()).toMatchObject({ tour_index: 1, stop_index: 2, playing: false });
    const told = paths.length;
    time.advance(60_000);
    expect([flying(), paths.length, reached]).toEqual([undefined, told, [[0, 0]]]);
    player.be_shown(7, 0); // a tour that this visitor does not have
    expect(state()).toMatchObject({ tour_index: 1, stop_index: 2 });
    player.be_shown(0, 9);
    expect(state()).toMatchObject({ tour_index: 0, stop: undefined });
    player.be_shown(1, 2);
    player.be_shown(undefined, undefined); // the leader sees nothing of the tours
    expect(state()).toMatchObject({ tour_index: 1, stop: undefined });
  });

  it('stays while a voice speaks, however short the stay is', () => {
    const { player, time, arrive, flying, speak, fall_silent, state } = guided();
    player.load([tour]);
    player.play();
    speak();
    arrive();
    time.advance(60_000);
    expect(flying()).toBeUndefined();
    fall_silent();
    expect(flying()).toBeDefined();
    arrive();
    speak();
    time.advance(2000);
    player.pause();
    fall_silent(); // nobody waits for it any more
    expect(flying()).toBeUndefined();
    expect(state()).toMatchObject({ stop_index: 1, playing: false });
  });

  it('shows the section of each stop, and all at stops without one', () => {
    const { player, arrive, sections } = guided();
    const section: Section = [0, 0, 0, 1, 1, 1, 0];
    const [first, ...others] = tour.stops;
    player.load([{ ...tour, stops: [{ ...first!, section }, ...others] }]);
    player.next();
    arrive();
    player.next();
    player.be_shown(0, 0);
    expect(sections).toEqual([section, undefined, section]);
  });

  it('goes from stop to stop and around', () => {
    const { player, arrive, state } = guided();
    player.load([tour]);
    expect(state().stop_index).toBeUndefined();
    player.next();
    expect(arrive()).toBe(1);
    player.previous();
    expect(arrive()).toBe(3);
    expect(state()).toMatchObject({ stop_index: 2, playing: false });
    player.next();
    expect(arrive()).toBe(1);
  });

  it('plays: stays at each stop as long as it says, then continues', () => {
    const { player, time, arrive, flying, state } = guided();
    player.load([tour]);
    player.play();
    expect(arrive()).toBe(1);
    time.advance(1900);
    expect(flying()).toBeUndefined();
    time.advance(200);
    expect(arrive()).toBe(2);
    player.pause();
    time.advance(60_000);
    expect(flying()).toBeUndefined();
    expect(state()).toMatchObject({ stop_index: 1, playing: false });
  });

  it('tells which stops were reached, and of none that were left before', () => {
    const { player, arrive, stop_flight, reached } = guided();
    player.load([tour, tour]);
    player.choose(1);
    player.next();
    expect(reached).toEqual([]);
    arrive();
    player.next();
    stop_flight(); // the visitor takes over
    player.show_stop(2);
    expect(reached).toEqual([
      [1, 0],
      [1, 2],
    ]);
  });

  it('flies as long as a stop says', () => {
    const { player, flying } = guided();
    player.load([{ ...tour, stops: [{ ...stop(1), fly_s: 7 }] }]);
    player.next();
    expect(flying()!.duration_s).toBe(7);
  });

  it('plays once for a preview, and ends after the last stay', () => {
    const { player, time, arrive, flying, state } = guided();
    let ends = 0;
    player.load([tour]);
    player.go_to(1);
    player.play_once(() => (ends += 1));
    for (const x of [1, 2, 3]) {
      expect(arrive()).toBe(x);
      expect(ends).toBe(0);
      time.advance(2100);
    }
    expect(ends).toBe(1);
    expect(flying()).toBeUndefined();
    expect(state().playing).toBe(false);
    player.play_once(() => (ends += 1));
    arrive();
    player.pause(); // the author looks around
    player.play();
    for (const x of [2, 3, 1]) {
      expect(arrive()).toBe(x);
      time.advance(2100);
    }
    expect(ends).toBe(1);
  });

  it('shows the card of a stop without going there', () => {
    const { player, flying, state } = guided();
    player.load([tour]);
    player.play();
    player.show_stop(1);
    expect(state()).toMatchObject({ stop_index: 1, playing: false });
    expect(flying()).toBeUndefined();
    player.show_stop(99);
    expect(state().stop_index).toBe(1);
  });

  it('ends when the visitor takes over', () => {
    const { player, time, paths, stop_flight, flying, state } = guided();
    player.load([tour]);
    player.play();
    stop_flight();
    expect(state().playing).toBe(false);
    expect(paths[paths.length - 1]).toEqual([]);
    time.advance(60_000);
    expect(flying()).toBeUndefined();
  });

  it('tells where the camera will be, and that it stays there', () => {
    const { player, paths, flying } = guided();
    player.load([tour]);
    player.go_to(2);
    const [path] = paths;
    expect(path!.length).toBeLessThanOrEqual(256);
    const { duration_s } = flying()!;
    expect(path![0]).toMatchObject({ time_us: 0, eye: { position: [0, 0, 0] } });
    const [arrival, held] = path!.slice(-2);
    expect(arrival!.time_us).toBeCloseTo(duration_s * 1e6, 3);
    expect_vec(arrival!.eye.position, [3, 0, 0]);
    expect(held!.eye).toEqual(arrival!.eye);
    expect(held!.time_us).toBeGreaterThan(arrival!.time_us);
  });

  it('begins by itself where the tour says so, but not for reduced motion', () => {
    const by_itself = guided();
    by_itself.player.load([{ ...tour, starts_itself: true }]);
    expect(by_itself.state().playing).toBe(true);
    const reduced = guided(true);
    reduced.player.load([{ ...tour, starts_itself: true }]);
    expect(reduced.state().playing).toBe(false);
    reduced.player.next();
    expect(reduced.flying()!.duration_s).toBe(0);
  });

  it('shows a film: glides to its begin, and announces it piece by piece', () => {
    const { player, time, paths, arrive, state } = guided();
    const way = { duration_s: 30, repeats: false, at: (s: number): Eye => ({ ...stop(s).eye }) };
    player.load([tour, { title: 'film', ...untranslated, stops: [], way, starts_itself: true }]);
    expect(state()).toMatchObject({ tour_index: 1, playing: true });
    arrive();
    const first = paths[paths.length - 1]!;
    expect(first[first.length - 1]!.eye.position[0]).toBeCloseTo(4, 5);
    time.advance(2000);
    const second = paths[paths.length - 1]!;
    expect(second[0]!.eye.position[0]).toBeCloseTo(2, 5);
    arrive();
    expect(state().playing).toBe(false);
    const count = paths.length;
    time.advance(60_000);
    expect(paths).toHaveLength(count);
  });
});
