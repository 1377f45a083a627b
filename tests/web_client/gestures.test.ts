import { describe, expect, it } from 'vitest';
import { LongPress, type Pointed } from '#client/input/pointers';
import { GestureRouter, type TakerName } from '#client/page/gestures';
import { FakeTime } from './fakes';

describe('the gesture router', () => {
  const click: Pointed = { x: 0.5, y: 0.5, how: 'click' };

  /** `names`: the takers, in the order in which they come; each takes what `takes` says. */
  function router(
    names: readonly TakerName[],
    takes: (name: TakerName, pointed: Pointed) => boolean = () => true,
  ) {
    const heard: TakerName[] = [];
    const gestures = new GestureRouter();
    for (const name of names) {
      gestures.set(name, (pointed) => {
        heard.push(name);
        return takes(name, pointed);
      });
    }
    return { gestures, heard };
  }

  it('asks the takers in a fixed order, whenever they came', () => {
    const { gestures, heard } = router(
      ['look', 'walk', 'dollhouse', 'measure', 'point'],
      () => false,
    );
    gestures.route(click);
    expect(heard).toEqual(['point', 'measure', 'dollhouse', 'walk', 'look']);
  });

  it('stops at the first that takes the gesture', () => {
    const { gestures, heard } = router(['walk', 'measure', 'look'], (name) => name === 'walk');
    gestures.route(click);
    expect(heard).toEqual(['measure', 'walk']);
  });

  it('gives a gesture back to the next one when a taker leaves', () => {
    const { gestures, heard } = router(['measure', 'look']);
    gestures.route(click);
    gestures.remove('measure');
    expect(gestures.has('measure')).toBe(false);
    gestures.route(click);
    expect(heard).toEqual(['measure', 'look']);
  });
});

describe('a long press', () => {
  function press() {
    const time = new FakeTime();
    const long = new LongPress(time);
    let pressed = 0;
    long.begin(100, 100, () => (pressed += 1));
    return { time, long, count: () => pressed };
  }

  it('comes once, after the pointer was held still', () => {
    const { time, long, count } = press();
    time.advance(599);
    expect([long.may_come(104, 103), count()]).toEqual([true, 0]);
    time.advance(1);
    expect([long.may_come(104, 103), count()]).toEqual([false, 1]);
    time.advance(10_000);
    expect(count()).toBe(1);
  });

  it('does not come of a drag, or of a pointer that was lifted', () => {
    const drag = press();
    expect(drag.long.may_come(100, 111)).toBe(false);
    drag.time.advance(10_000);
    expect(drag.count()).toBe(0);
    const tap = press();
    tap.long.end();
    tap.time.advance(10_000);
    expect(tap.count()).toBe(0);
  });
});
