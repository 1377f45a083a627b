// Chromium as the tests use it, and a page that records everything that went wrong in it.
import { existsSync, mkdirSync } from 'node:fs';
import path from 'node:path';
import {
  chromium,
  type Browser,
  type BrowserContext,
  type BrowserContextOptions,
  type Page,
} from 'playwright-core';
import { afterEach } from 'vitest';
import { settle } from './camera';
import { clean_up } from './clean_up';
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

let browser: Browser | undefined;

async function launch_browser(): Promise<Browser> {
  if (!existsSync(chromium_path)) {
    throw new Error(`no Chromium at ${chromium_path}: apt install chromium, or set CATGS_CHROMIUM`);
  }
  const launched = await chromium.launch({
    executablePath: chromium_path,
    headless: true,
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
  clean_up(() => launched.close());
  return launched;
}

export interface WatchedPage {
  readonly page: Page;
  /** Console errors, uncaught exceptions and violations of the CSP so far. */
  readonly errors: string[];
}

const open_contexts: BrowserContext[] = [];

afterEach(async () => {
  for (const context of open_contexts.splice(0)) await context.close();
});

/** A page that is closed after the test, in a browser that all tests of a file share. */
export async function new_page(
  options: BrowserContextOptions = { viewport: { width: 640, height: 360 } },
): Promise<WatchedPage> {
  browser ??= await launch_browser();
  const context = await browser.newContext(options);
  open_contexts.push(context);
  const page = await context.newPage();
  const errors: string[] = [];
  page.on('console', (message) => {
    if (message.type() === 'error') errors.push(message.text());
  });
  page.on('pageerror', (error) => errors.push(String(error)));
  return { page, errors };
}

/** A page that shows its first picture. */
export async function open(url: string, options?: BrowserContextOptions): Promise<WatchedPage> {
  const watched = await new_page(options);
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
