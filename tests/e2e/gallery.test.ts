// Keeps every state of the page as a picture for people to look at: desktop, phone, light and dark. It
// also checks that everything is inside the window, that nothing covers the buttons, and that axe-core finds
// no barrier.
import { beforeAll, describe, expect, it } from 'vitest';
import type { Page } from 'playwright-core';
import type { SceneListing } from '#client/session/scenes';
import { Error_Code } from '#client/wire/wire';
import { barriers } from './support/axe';
import { keep_screenshot, new_page, windows } from './support/browser';
import { settle } from './support/camera';
import {
  at_hello,
  refuse,
  start_fake_server,
  type FakeServer,
  type Script,
} from './support/fake_server';
import { painted_jpeg, stream_of } from './support/painted';

let stream: Script;
let poster: Uint8Array;

beforeAll(async () => {
  poster = await painted_jpeg();
  stream = stream_of(poster);
});

const several = [
  { id: 'city', title: 'Demo city' },
  {
    id: 'hall',
    title: 'The great hall of the old town',
    credits: 'Ada Lovelace',
    licence: 'CC-BY-4.0',
  },
  { id: 'garden', title: 'garden' },
];

interface State {
  readonly script?: Script; // undefined: a stream
  readonly query?: string;
  readonly scenes?: readonly Partial<SceneListing>[]; // of the server, which has one otherwise
  readonly tours?: readonly object[]; // of the scene
  /** Leads the page into the state. */
  readonly reach?: (page: Page, server: FakeServer) => Promise<void>;
  /** Resolves when the page shows it, in the window that it has now. */
  readonly shown: (page: Page, server: FakeServer) => Promise<void>;
}

const title =
  (text: string) =>
  (page: Page): Promise<void> =>
    page.getByRole('heading', { name: text }).waitFor();

const button =
  (name: string) =>
  (page: Page): Promise<void> =>
    page.getByRole('button', { name }).waitFor();

const panel = (name: string, id: string): Pick<State, 'reach' | 'shown'> => ({
  reach: async (page) => {
    await settle(page);
    await page.locator('#toolbar').getByRole('button', { name }).click();
  },
  shown: (page) => page.locator(`#${id}-panel`).waitFor(),
});

const mode = (presses: number, name: string): Pick<State, 'reach' | 'shown'> => ({
  reach: async (page) => {
    await settle(page);
    for (let i = 0; i < presses; ++i) await page.keyboard.press('KeyM');
  },
  shown: (page) => page.locator('#mode-label', { hasText: name }).waitFor(),
});

const stop = (caption: string): object => ({
  title: 'Hall',
  caption,
  position: [0, 0, -5],
  look_at: [0, 0, 0],
  marker: [0, 0, 2],
});
const tours = [{ title: 'Ground floor', stops: [stop('Built in 1904. '.repeat(30)), stop('')] }];

const states: Readonly<Record<string, State>> = {
  connecting: { script: () => undefined, shown: title('Connecting') },
  queue: {
    script: at_hello({ case: 'queue', value: { position: 2, estimateS: 45 } }),
    shown: title('Number 2 in the queue'),
  },
  'scene-loading': {
    script: at_hello({ case: 'queue', value: { position: 1, estimateS: 20, forScene: true } }),
    shown: title('Loading the scene'),
  },
  token: {
    script: refuse(
      Error_Code.UNAUTHORIZED,
      'this server needs an access token: open the link you were given',
    ),
    shown: title('Access token needed'),
  },
  scenes: {
    scenes: several,
    shown: async (page) => {
      await page.waitForFunction(() =>
        [...document.querySelectorAll<HTMLImageElement>('#gallery img')].every(
          (img) => img.naturalWidth > 0,
        ),
      );
    },
  },
  'no-scene': {
    scenes: several,
    script: refuse(Error_Code.UNKNOWN_SCENE, 'there is no scene "nope" here'),
    query: '?scene=nope',
    shown: (page) => page.getByRole('link', { name: 'garden' }).waitFor(),
  },
  busy: {
    script: refuse(Error_Code.SERVER_FULL, '16 of 16 sessions are in use'),
    shown: title('The server is busy'),
  },
  idle: {
    script: refuse(Error_Code.IDLE_TIMEOUT, 'nothing moved for 10 minutes'),
    shown: title('Paused'),
  },
  'old-page': {
    script: refuse(Error_Code.UNSUPPORTED_VERSION, 'this server speaks version 2'),
    shown: title('does not match the server'),
  },
  view: { shown: settle },
  lost: {
    reach: async (page, server) => {
      await settle(page);
      await server.close();
    },
    shown: button('Try now'),
  },
  broken: {
    reach: async (page) => {
      await settle(page);
      await page.evaluate(() =>
        window.dispatchEvent(
          new ErrorEvent('error', {
            message: 'a planted fault',
            filename: document.querySelector<HTMLScriptElement>('script[type=module]')!.src,
          }),
        ),
      );
    },
    shown: button('Dismiss'),
  },
  fly: mode(1, 'Fly'),
  walk: mode(2, 'Walk'),
  tour: {
    tours,
    reach: async (page) => {
      await settle(page);
      await page.getByRole('button', { name: 'Next stop' }).click();
    },
    shown: (page) => page.getByText('1 of 2').waitFor(),
  },
  quality: panel('Quality and view', 'quality'),
  share: panel('Share', 'share'),
  help: panel('Controls', 'help'),
  author: { query: '?author', shown: button('Add a stop here') },
  statistics: {
    ...panel('Statistics', 'stats'),
    shown: async (page) => {
      await expect.poll(() => page.locator('.uplot canvas').count()).toBe(2);
    },
  },
  'statistics-at-rest': {
    ...panel('Statistics', 'stats'),
    shown: (page) => page.getByText('The camera rests').waitFor(),
  },
  notice: {
    reach: settle,
    shown: async (page, server) => {
      const message = 'nothing has moved for 9 minutes: your place goes to others in a minute';
      server.peers[0]!.say({
        case: 'error',
        value: { code: Error_Code.IDLE_TIMEOUT, message, fatal: false },
      });
      await page.locator('#notice').waitFor();
    },
  },
};

/** Elements above the picture that leave the window or cover the toolbar. */
const misplaced = (page: Page): Promise<string[]> =>
  page.evaluate(() => {
    const bar = document.getElementById('toolbar')!.getBoundingClientRect();
    return [...document.querySelectorAll<HTMLElement>('.glass')].flatMap((element) => {
      const { left, right, top, bottom, width } = element.getBoundingClientRect();
      if (width === 0) return []; // hidden
      const outside = left < 0 || top < 0 || right > innerWidth || bottom > innerHeight;
      const on_bar =
        element.id !== 'toolbar' &&
        left < bar.right &&
        right > bar.left &&
        bottom > bar.top &&
        top < bar.bottom;
      return [
        ...(outside ? [`${element.id} leaves the window`] : []),
        ...(on_bar ? [`${element.id} lies on the toolbar`] : []),
      ];
    });
  });

/** The windows of one kind of pointer. One page takes their sizes and colours in turn. */
const contexts = {
  mouse: ['desktop', 'desktop-dark'],
  touch: ['phone', 'phone-dark'],
} as const satisfies Record<string, readonly (keyof typeof windows)[]>;

async function take_window(page: Page, name: keyof typeof windows): Promise<void> {
  const { viewport, ...rest } = windows[name];
  await page.setViewportSize(viewport);
  await page.emulateMedia({ colorScheme: 'colorScheme' in rest ? rest.colorScheme : 'light' });
  // The page has laid itself out anew.
  await page.evaluate(
    () => new Promise((resolve) => requestAnimationFrame(() => requestAnimationFrame(resolve))),
  );
}

describe.each(Object.entries(contexts))('%s', (_, names) => {
  it.each(Object.entries(states))(
    'shows the state %s whole',
    async (state, { reach, shown, query = '', script = stream, ...rest }) => {
      const server = await start_fake_server(script, {
        scenes: several.slice(0, 1),
        poster,
        ...rest,
      });
      const { page, errors } = await new_page(windows[names[0]]);
      await page.goto(server.url + query);
      await reach?.(page, server);
      for (const name of names) {
        await take_window(page, name);
        await shown(page, server);
        await keep_screenshot(page, `state-${state}-${name}`);
        expect(await misplaced(page), name).toEqual([]);
        expect(await barriers(page), name).toEqual([]);
      }
      if (state !== 'lost') expect(errors).toEqual([]);
    },
  );
});
