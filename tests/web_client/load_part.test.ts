import { afterEach, beforeEach, describe, expect, it, vi } from 'vitest';
import { load_part, part_missing } from '#client/base/load_part';
import { load_author_page } from '#client/author_editor';

describe('a part of the page', () => {
  let told: boolean[];
  part_missing.listen((missing) => told.push(missing));

  beforeEach(() => {
    told = [];
    vi.useFakeTimers();
  });
  afterEach(() => vi.useRealTimers());

  const failing = (times: number) => {
    let left = times;
    return vi.fn(() => (left-- > 0 ? Promise.reject(new Error('no')) : Promise.resolve('part')));
  };

  it('is loaded once where it comes', async () => {
    const load = failing(0);
    expect(await load_part(load)).toBe('part');
    expect(load).toHaveBeenCalledTimes(1);
    expect(told).toEqual([]);
  });

  it('is tried again, and the visitor is told until it comes', async () => {
    const part = load_part(failing(2));
    await vi.advanceTimersByTimeAsync(2900);
    expect(told).toEqual([true]);
    await vi.advanceTimersByTimeAsync(200);
    expect(await part).toBe('part');
    expect(told).toEqual([true, false]);
  });

  it('is given up after a minute, and is missing from then on', async () => {
    const load = failing(100);
    const part = load_part(load).catch(() => 'given up');
    await vi.advanceTimersByTimeAsync(70_000);
    expect(await part).toBe('given up');
    expect(load).toHaveBeenCalledTimes(7);
    expect(told).toEqual([true]);
  });

  it('is asked for until it comes, if it is the editor', async () => {
    const page = load_author_page(failing(10) as never);
    await vi.advanceTimersByTimeAsync(90_000);
    expect(await page).toBe('part');
    expect(told.at(-1)).toBe(false);
  });
});
