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
import { at_hello, refuse, start_fake_server, type FakeServer, type Script } from './support/fake_server';
import { painted_jpeg, stream_of } from './support/painted';

let stream: Script;
let poster: Uint8Array;

beforeAll(async () => {
  poster = await painted_jpeg();
  stream = stream_of(poster);
});

const several = [
  { id: 'city', title: 'Demo city' },
  { id: 'hall', title: 'The great hall of the old town', credits: 'Ada Lovelace', licence: 'CC-BY-4.0' },
  { id: 'garden', title: 'garden' },
];

interface State {
  readonly script?: Script; // undefined: a stream
  readonly query?: string;
  readonly scenes?: readonly Partial<SceneListing>[]; // of the server, which has one otherwise
  readonly tours?: readonly object[]; // of the scene
  readonly reach: (page: Page, server: FakeServer) => Promise<void>;
}

const title =
  (text: string) =>
  (page: Page): Promise<void> =>
    page.getByRole('heading', { name: text }).waitFor();

const panel =
  (button: string) =>
  async (page: Page): Promise<void> => {
    await settle(page);
    await page.locator('#toolbar').getByRole('button', { name: button }).click();
  };

const mode =
  (presses: number) =>
  async (page: Page): Promise<void> => {
    await settle(page);
    for (let i = 0; i < presses; ++i) await page.keyboard.press('KeyM');
  };

const stop = (caption: string): object => ({ title: 'Hall', caption, position: [0, 0, -5], look_at: [0, 0, 0], marker: [0, 0, 2] });
const tours = [{ title: 'Ground floor', stops: [stop('Built in 1904. '.repeat(30)), stop('')] }];

const states: Readonly<Record<string, State>> = {
  connecting: { script: () => undefined, reach: title('Connecting') },
  queue: {
    script: at_hello({ case: 'queue', value: { position: 2, estimateS: 45 } }),
    reach: title('Number 2 in the queue'),
  },
  'scene-loading': {
    script: at_hello({ case: 'queue', value: { position: 1, estimateS: 20, forScene: true } }),
    reach: title('Loading the scene'),
  },
  token: {
    script: refuse(Error_Code.UNAUTHORIZED, 'this server needs an access token: open the link you were given'),
    reach: title('Access token needed'),
  },
  scenes: {
    scenes: several,
    reach: async (page) => {
      await page.waitForFunction(() =>
        [...document.querySelectorAll<HTMLImageElement>('#gallery img')].every((img) => img.naturalWidth > 0),
      );
    },
  },
  'no-scene': {
    scenes: several,
    script: refuse(Error_Code.UNKNOWN_SCENE, 'there is no scene "nope" here'),
    query: '?scene=nope',
    reach: async (page) => {
      await page.getByRole('link', { name: 'garden' }).waitFor();
    },
  },
  busy: { script: refuse(Error_Code.SERVER_FULL, '16 of 16 sessions are in use'), reach: title('The server is busy') },
  idle: { script: refuse(Error_Code.IDLE_TIMEOUT, 'nothing moved for 10 minutes'), reach: title('Paused') },
  'old-page': {
    script: refuse(Error_Code.UNSUPPORTED_VERSION, 'this server speaks version 2'),
    reach: title('do not fit together'),
  },
  view: { reach: settle },
  lost: {
    reach: async (page, server) => {
      await settle(page);
      await server.close();
      await page.getByRole('button', { name: 'Try now' }).waitFor();
    },
  },
  broken: {
    reach: async (page) => {
      await settle(page);
      await page.evaluate(() => window.dispatchEvent(new ErrorEvent('error', { message: 'a planted fault' })));
      await page.getByRole('button', { name: 'Reload' }).waitFor();
    },
  },
  fly: { reach: mode(1) },
  walk: { reach: mode(2) },
  tour: {
    tours,
    reach: async (page) => {
      await settle(page);
      await page.getByRole('button', { name: 'Next stop' }).click();
      await page.getByText('1 of 2').waitFor();
    },
  },
  quality: { reach: panel('Quality and view') },
  share: { reach: panel('Share') },
  help: { reach: panel('Controls') },
  author: {
    query: '?author',
    reach: async (page) => {
      await page.getByRole('button', { name: 'Add a stop here' }).waitFor();
    },
  },
  statistics: {
    reach: async (page) => {
      await panel('Statistics')(page);
      await expect.poll(() => page.locator('.uplot canvas').count()).toBe(2);
    },
  },
  'statistics-at-rest': {
    reach: async (page) => {
      await panel('Statistics')(page);
      await page.getByText('The camera rests').waitFor();
    },
  },
  notice: {
    script: (peer, body) => {
      stream(peer, body);
      const message = 'nothing has moved for 9 minutes: your place goes to others in a minute';
      if (body.case === 'hello') peer.say({ case: 'error', value: { code: Error_Code.IDLE_TIMEOUT, message, fatal: false } });
    },
    reach: async (page) => {
      await settle(page);
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
        element.id !== 'toolbar' && left < bar.right && right > bar.left && bottom > bar.top && top < bar.bottom;
      return [...(outside ? [`${element.id} leaves the window`] : []), ...(on_bar ? [`${element.id} lies on the toolbar`] : [])];
    });
  });

describe.each(Object.entries(windows))('%s', (name, options) => {
  it.each(Object.entries(states))('shows the state %s whole', async (state, { reach, query = '', script = stream, ...rest }) => {
    const server = await start_fake_server(script, { scenes: several.slice(0, 1), poster, ...rest });
    const { page, errors } = await new_page(options);
    await page.goto(server.url + query);
    await reach(page, server);
    await keep_screenshot(page, `state-${state}-${name}`);
    expect(await misplaced(page)).toEqual([]);
    expect(await barriers(page)).toEqual([]);
    if (state !== 'lost') expect(errors).toEqual([]);
  });
});
