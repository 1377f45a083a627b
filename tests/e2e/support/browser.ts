// Chromium as the tests use it, and a page that records everything that went wrong in it.
import { existsSync, mkdirSync } from 'node:fs';
import path from 'node:path';
import { chromium, type Browser, type BrowserContextOptions, type Page } from 'playwright-core';
import { settle } from './camera';
import { artefacts, chromium_path } from './paths';

export const insecure_host = 'plain.test';

/** Windows for people to look at. */
export const windows = {
  desktop: { viewport: { width: 1280, height: 720 } },
  'desktop-dark': { viewport: { width: 1280, height: 720 }, colorScheme: 'dark' },
  phone: { viewport: { width: 360, height: 640 }, hasTouch: true, isMobile: true },
  'phone-dark': {
    viewport: { width: 740, height: 360 },
    hasTouch: true,
    isMobile: true,
    colorScheme: 'dark',
  },
} as const satisfies Record<string, BrowserContextOptions>;

let browser: Promise<Browser> | undefined;

/** `without`: arguments of the test tools that this browser does not get. It ends with this process. */
export function launch_browser(without: string[] = []): Promise<Browser> {
  if (!existsSync(chromium_path)) {
    throw new Error(`no Chromium at ${chromium_path}: apt install chromium, or set CATGS_CHROMIUM`);
  }
  return chromium.launch({
    executablePath: chromium_path,
    headless: true,
    ignoreDefaultArgs: without,
    args: [
      '--no-sandbox',
      '--disable-gpu',
      '--disable-quic',
      '--no-first-run',
      '--disable-background-networking',
      '--disable-component-update',
      '--disable-sync',
      // A name of this machine that is no secure context.
      `--host-resolver-rules=MAP ${insecure_host} 127.0.0.1`,
    ],
  });
}

export interface WatchedPage {
  readonly page: Page;
  /** Console errors, uncaught exceptions and violations of the CSP so far. */
  readonly errors: string[];
}

/** A function that sees nothing but the page, or the text of a script. */
type Script = string | (() => void);

/** A page in a context of its own. After a test it is emptied, and a later test of the same kind gets it. */
interface Tab {
  readonly page: Page;
  readonly kind: string;
  readonly is_prepared: boolean; // by a script that nothing takes out again
  readonly origins: Set<string>; // of the documents since it was emptied; each has its storage
}

const used: Tab[] = [];
const free: Tab[] = [];

const default_options: BrowserContextOptions = { viewport: { width: 640, height: 360 } };

/** The options that a page keeps for its life. The others are set for each test. */
const kind_of = (options: BrowserContextOptions): string =>
  JSON.stringify({ ...options, viewport: 0, colorScheme: 0, reducedMotion: 0 });

/** Takes what the test has left in the page: listeners, routes, settings, and its visit. */
async function empty({ page, origins }: Tab): Promise<void> {
  for (const event of ['console', 'pageerror', 'request'] as const) page.removeAllListeners(event);
  await page.unrouteAll({ behavior: 'ignoreErrors' });
  for (const other of page.context().pages()) if (other !== page) await other.close();
  for (const frame of page.frames())
    await frame
      .evaluate(() => {
        localStorage.clear();
        sessionStorage.clear();
      })
      .catch(() => undefined); // a frame without an origin has no storage
  origins.clear();
  await page.goto('about:blank');
  await page.mouse.move(0, 0);
}

/** Empties it for the next test, or closes it where that is not enough. */
async function give_back(tab: Tab, is_reusable: boolean): Promise<void> {
  const is_dirty = tab.is_prepared || tab.origins.size > 1 || tab.page.isClosed();
  if (!is_reusable || is_dirty) return tab.page.context().close();
  await empty(tab);
  free.push(tab);
}

/** Takes back the pages of a test. Those of a failed one are not used again. */
export async function give_back_pages(are_reusable: boolean): Promise<void> {
  for (const tab of used.splice(0)) await give_back(tab, are_reusable);
}

async function take_tab(options: BrowserContextOptions, prepare?: Script): Promise<Tab> {
  const kind = kind_of(options);
  const at = prepare ? -1 : free.findIndex((tab) => tab.kind === kind);
  const [tab] = at < 0 ? [await make_tab(options, kind, prepare)] : free.splice(at, 1);
  await tab!.page.setViewportSize(options.viewport ?? windows.desktop.viewport);
  await tab!.page.emulateMedia({
    colorScheme: options.colorScheme ?? 'light',
    reducedMotion: options.reducedMotion ?? 'no-preference',
  });
  return tab!;
}

async function make_tab(
  options: BrowserContextOptions,
  kind: string,
  prepare?: Script,
): Promise<Tab> {
  browser ??= launch_browser();
  const context = await (await browser).newContext(options);
  if (prepare) await context.addInitScript(prepare);
  const origins = new Set<string>();
  context.on('request', (request) => {
    if (request.isNavigationRequest()) origins.add(new URL(request.url()).origin);
  });
  return { page: await context.newPage(), kind, is_prepared: prepare !== undefined, origins };
}

/** Does something in a page, and returns what that returns. */
export async function in_page<T>(work: (page: Page) => Promise<T>): Promise<T> {
  const tab = await take_tab(default_options);
  const made = await work(tab.page);
  await give_back(tab, true);
  return made;
}

/**
 * A page for this test, in a browser that all tests share. `prepare` runs in it before any script of its
 * documents.
 */
export async function new_page(
  options: BrowserContextOptions = default_options,
  prepare?: Script,
): Promise<WatchedPage> {
  const tab = await take_tab(options, prepare);
  used.push(tab);
  const { page } = tab;
  const errors: string[] = [];
  page.on('console', (message) => {
    if (message.type() === 'error') errors.push(message.text());
  });
  page.on('pageerror', (error) => errors.push(String(error)));
  return { page, errors };
}

/** A page that shows its first picture. */
export async function open(
  url: string,
  options?: BrowserContextOptions,
  prepare?: Script,
): Promise<WatchedPage> {
  const watched = await new_page(options, prepare);
  await watched.page.goto(url);
  await settle(watched.page);
  return watched;
}

/**
 * Chooses the full size of the view, because the automatic size depends on how busy this machine is.
 * Leaves the keyboard to the view.
 */
export async function choose_full_size(page: Page): Promise<void> {
  await page.getByRole('button', { name: 'Quality and view' }).click();
  await page.getByLabel('Picture').selectOption('0');
  await page.keyboard.press('Escape');
  await page.locator('#view').focus();
}

export async function keep_screenshot(page: Page, name: string): Promise<void> {
  mkdirSync(artefacts, { recursive: true });
  await page.screenshot({ path: path.join(artefacts, `${name}.png`) });
}
