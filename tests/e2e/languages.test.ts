// The page in the languages that it speaks, against a server that follows a script.
import type { BrowserContextOptions, Page } from 'playwright-core';
import { beforeAll, describe, expect, it } from 'vitest';
import { barriers } from './support/axe';
import { keep_screenshot, new_page, open } from './support/browser';
import { settle } from './support/camera';
import { at_hello, start_fake_server, type FakeServer } from './support/fake_server';
import { painted_jpeg, stream_of } from './support/painted';

const windows: Readonly<Record<string, BrowserContextOptions>> = {
  desktop: { viewport: { width: 1280, height: 720 } },
  phone: { viewport: { width: 390, height: 844 }, hasTouch: true, isMobile: true },
};

const square = {
  de: { title: 'Der Platz', caption: 'Hier war seit 1290 Markt.' },
  ja: { title: '広場', caption: '1290年からここで市が開かれました。' },
  ar: { title: 'الساحة', caption: 'أقيمت الأسواق هنا منذ عام 1290.' },
};
const stop = { position: [0, 0, -5], orientation: [0, 0, 0, 1] };
const tours = [
  {
    title: 'The old town',
    translations: {
      de: { title: 'Die Altstadt' },
      ja: { title: '旧市街' },
      ar: { title: 'البلدة القديمة' },
    },
    stops: [
      {
        ...stop,
        title: 'The square',
        caption: 'Markets were held here from 1290 on.',
        marker: [1, 0, 0],
        translations: square,
      },
      { ...stop, title: 'The tower', marker: [-1, 0, 0] },
    ],
  },
];
const scenes = [
  { id: 'city', title: 'Demo city', credits: 'Ada', licence: 'MIT' },
  { id: 'hall', title: 'The hall' },
];
const panels = ['quality', 'stats', 'views', 'share', 'help'] as const;

// axe-core's rules find the same in both windows: it looks at whole pages on a desktop, and at panels on a phone.
const is_desktop = (window: string): boolean => window === 'desktop';

let server: FakeServer;
let full: FakeServer; // all wait in its queue

beforeAll(async () => {
  server = await start_fake_server(stream_of(await painted_jpeg()), { tours, scenes });
  full = await start_fake_server(
    at_hello({ case: 'queue', value: { position: 12, estimateS: 45 } }),
  );
});

const speaks = (page: Page): Promise<[string, string]> =>
  page.evaluate(() => [document.documentElement.lang, document.documentElement.dir]);

/** Buttons, labels and lines whose text does not fit into them, and whatever lies outside of the window. */
const cut_off = (page: Page): Promise<string[]> =>
  page.evaluate(() => {
    const shown = [
      ...document.querySelectorAll<HTMLElement>(
        'button, label, option, legend, th, td, h1, h2, p, .glass',
      ),
    ].filter((element) => element.checkVisibility() && !element.closest('#hotspots, #scene-title'));
    const outside = ({ left, right }: DOMRect): boolean => left < -1 || right > innerWidth + 1;
    return shown
      .filter(
        (element) =>
          element.scrollWidth > element.clientWidth + 1 &&
          getComputedStyle(element).display !== 'inline',
      )
      .concat(shown.filter((element) => outside(element.getBoundingClientRect())))
      .map(
        (element) => `${element.tagName}#${element.id} ${element.textContent.trim().slice(0, 40)}`,
      );
  });

describe.each([
  ['en-GB', 'en', 'ltr', 'The square', 'Share'],
  ['de-CH', 'de', 'ltr', 'Der Platz', 'Teilen'],
  ['ja-JP', 'ja', 'ltr', '広場', '共有'],
  ['ar-EG', 'ar', 'rtl', 'الساحة', 'مشاركة'],
])('for a visitor who reads %s', (locale, language, direction, title, share) => {
  it.each(Object.keys(windows))('the page says everything so, on a %s', async (name) => {
    const { page, errors } = await open(`${server.url}?scene=city`, { ...windows[name], locale });
    expect(await speaks(page)).toEqual([language, direction]);
    await page.locator('#tour-next').click();
    await page.getByRole('heading', { name: title }).waitFor();
    expect(await page.locator('#tour-text').getAttribute('lang')).toBe(
      language === 'en' ? '' : language,
    );
    await page.getByRole('button', { name: share, exact: true }).waitFor();
    await keep_screenshot(page, `language-${language}-${name}`);
    expect(await cut_off(page)).toEqual([]);
    if (is_desktop(name)) expect(await barriers(page)).toEqual([]);
    for (const panel of panels) {
      await page.locator(`#button-${panel}`).click();
      if (panel === 'views') await page.locator('#views-panel fieldset').last().waitFor();
      if (panel === 'stats') await page.locator('#stats-panel .uplot').last().waitFor();
      await keep_screenshot(page, `language-${language}-${name}-${panel}`);
      expect(await cut_off(page)).toEqual([]);
      if (!is_desktop(name)) expect(await barriers(page)).toEqual([]);
      await page.locator(`#button-${panel}`).click();
    }
    expect(errors).toEqual([]);
  });

  it.each(Object.keys(windows))('the gallery, a queue and the editor do, on a %s', async (name) => {
    const { page } = await new_page({ ...windows[name], locale });
    await page.goto(server.url);
    await page.getByRole('link', { name: 'Demo city' }).waitFor();
    await keep_screenshot(page, `language-${language}-${name}-gallery`);
    expect(await speaks(page)).toEqual([language, direction]);
    if (is_desktop(name)) expect(await barriers(page)).toEqual([]);

    await page.goto(full.url);
    await page.locator('#card-action').waitFor();
    await keep_screenshot(page, `language-${language}-${name}-queue`);
    expect(await cut_off(page)).toEqual([]);
    if (is_desktop(name)) expect(await barriers(page)).toEqual([]);

    await page.goto(`${server.url}?scene=city&author`);
    await settle(page);
    await page.locator('#author-stops li').first().waitFor();
    await keep_screenshot(page, `language-${language}-${name}-author`);
    expect(await cut_off(page)).toEqual([]);
    if (!is_desktop(name)) expect(await barriers(page)).toEqual([]);
  });
});

it.each(['fr', 'es', 'it', 'zh', 'ko'])('?lang=%s chooses a language', async (lang) => {
  const { page, errors } = await open(`${server.url}?scene=city&lang=${lang}`, windows['phone']);
  expect((await speaks(page))[0]).toMatch(new RegExp(`^${lang}`));
  await page.locator('#button-views').click();
  await page.locator('#views-panel fieldset').last().waitFor();
  await keep_screenshot(page, `language-${lang}-phone-views`);
  expect(await cut_off(page)).toEqual([]);
  await page.locator('#button-help').click();
  await keep_screenshot(page, `language-${lang}-phone-help`);
  expect([await cut_off(page), await barriers(page), errors]).toEqual([[], [], []]);
  // A link is for others, who may read another language.
  await page.locator('#button-share').click();
  expect(await page.locator('#share-link').inputValue()).not.toContain('lang=');
});

it('is English where the visitor’s language does not come', async () => {
  const { page } = await new_page({ locale: 'de-DE' });
  await page.route('**/de-*.js', (route) => route.abort());
  await page.goto(`${server.url}?scene=city`);
  await page.getByRole('button', { name: 'Back to the start' }).waitFor();
  expect(await speaks(page)).toEqual(['en', 'ltr']);
});

it('an author writes for all visitors, and for those who read one language', async () => {
  const { page } = await open(`${server.url}?scene=city&author`, windows['desktop']);
  const title = page.getByLabel('Title of stop 1');
  await expect.poll(() => title.inputValue()).toBe('The square');
  await page.getByLabel('Texts for').selectOption('German');
  expect(await title.inputValue()).toBe('Der Platz');
  await title.fill('Der Markt');
  await page.getByRole('button', { name: 'Show' }).first().click();
  await page.getByRole('heading', { name: 'Der Markt' }).waitFor();
  await page.getByLabel('Texts for').selectOption('all visitors');
  expect(await title.inputValue()).toBe('The square');
  await page.getByRole('button', { name: 'Show' }).first().click();
  await page.getByRole('heading', { name: 'The square' }).waitFor();
  const download = page.waitForEvent('download');
  await page.getByRole('button', { name: 'Download the file' }).click();
  const chunks: Buffer[] = [];
  for await (const chunk of await (await download).createReadStream()) chunks.push(chunk as Buffer);
  const saved = JSON.parse(Buffer.concat(chunks).toString()) as { tours: typeof tours };
  expect(saved.tours[0]!.stops[0]).toMatchObject({
    title: 'The square',
    translations: { ...square, de: { title: 'Der Markt', caption: square.de.caption } },
  });
});
