import { readdirSync, readFileSync } from 'node:fs';
import path from 'node:path';
import { fileURLToPath } from 'node:url';
import { afterEach, beforeEach, describe, expect, it, vi } from 'vitest';
import { browser_storage } from '#client/base/browser_storage';
import { remember_rung, remembered_rung } from '#client/decode/decoder_memory';
import { Sounds, type Playable } from '#client/media/sounds';
import { AccessToken } from '#client/session/token';

const source = fileURLToPath(new URL('../../web_client/src', import.meta.url));
const refuse = (): never => {
  throw new DOMException('full', 'QuotaExceededError');
};
const works = { getItem: () => null, setItem: () => undefined };

describe('browser storage', () => {
  beforeEach(() => void vi.spyOn(console, 'warn').mockImplementation(() => undefined));

  afterEach(() => {
    vi.restoreAllMocks();
    vi.unstubAllGlobals();
  });

  it.each([
    ['cannot be reached', (): never => refuse()],
    ['cannot be read', () => ({ ...works, getItem: refuse })],
    ['is full', () => ({ ...works, setItem: refuse })],
    ['is absent', () => null],
  ])('that %s stops nothing, and keeps texts for the page', (_name, open) => {
    vi.stubGlobal('window', Object.defineProperty({}, 'localStorage', { get: open }));
    const storage = browser_storage('localStorage');
    const history = { state: null, replaceState: () => undefined };
    const token_of = (href: string): string => new AccessToken({ href }, history, storage).value;
    expect(token_of('http://host/#token=x')).toBe('x');
    expect(token_of('http://host/')).toBe('x');
    remember_rung('jpeg', storage, 'a', 0);
    expect(remembered_rung(storage, 'a', 1)).toBe('jpeg');
    const element = (): Playable =>
      ({ play: () => Promise.resolve(), pause: () => undefined }) as unknown as Playable;
    const sounds = new Sounds({
      voice: element(),
      background: element(),
      touched: true,
      storage,
      changed: () => undefined,
    });
    sounds.toggle();
    expect(sounds.audible).toBe(false);
    expect(console.warn).toHaveBeenCalledOnce();
  });

  it('has one user, which guards it', () => {
    const users = readdirSync(source, { recursive: true, encoding: 'utf8' }).filter(
      (file) =>
        file.endsWith('.ts') &&
        /\.(local|session)Storage\b|^[^'"]*\b(local|session)Storage\./m.test(
          readFileSync(path.join(source, file), 'utf8'),
        ),
    );
    expect(users).toEqual([]);
  });
});
