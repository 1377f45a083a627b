// charts.html: one file that draws a document inside it, or the answer of the server that it comes from.
import { mkdirSync, readFileSync, writeFileSync } from 'node:fs';
import { createServer } from 'node:http';
import path from 'node:path';
import { pathToFileURL } from 'node:url';
import { expect, it } from 'vitest';
import type { ChartDocument } from '#client/charts/chart_document';
import { keep_screenshot, new_page } from './support/browser';
import { clean_up } from './support/clean_up';
import { artefacts, build_dir } from './support/paths';

const page_text = readFileSync(path.join(build_dir, 'web_client/dist/charts.html'), 'utf-8');

const shown: ChartDocument = {
  title: 'A run',
  facts: '2 clients',
  links: [{ text: 'CSV', href: '/visits.csv' }],
  parts: [
    {
      heading: 'Clients',
      table: {
        columns: ['name', 'ms'],
        rows: [
          ['<b>bold</b>', 12.3456],
          ['none', null],
        ],
      },
    },
    {
      heading: 'Over time',
      plots: [
        {
          title: 'Delay',
          unit: 'ms',
          curves: [
            { name: 'first', x: [0, 1, 2], y: [5, null, 7] },
            { name: 'bound', x: [0, 2], y: [33, 33], bound: true },
          ],
        },
        {
          title: 'Shares',
          unit: '%',
          x: 'log',
          curves: [{ name: 'first', x: [1, 10, 100], y: [1, 50, 99] }],
        },
        {
          title: 'Visits',
          unit: '',
          x: 'dates',
          bars: true,
          curves: [{ name: 'visits', x: ['2026-11-25', '2026-11-26', '2026-11-27'], y: [1, 3, 2] }],
        },
      ],
    },
  ],
};

it('draws the document inside it, without a server and without anything from elsewhere', async () => {
  mkdirSync(artefacts, { recursive: true });
  const file = path.join(artefacts, 'charts.html');
  writeFileSync(
    file,
    page_text.replace('id="document">', () => `id="document">${JSON.stringify(shown)}`),
  );
  const { page, errors } = await new_page({ viewport: { width: 1000, height: 900 } });
  const requests: string[] = [];
  page.on('request', (request) => requests.push(request.url()));
  await page.goto(pathToFileURL(file).href);
  await expect.poll(() => page.locator('canvas').count()).toBe(3);
  expect(await page.locator('.wide td').allTextContents()).toEqual([
    '<b>bold</b>',
    '12.35',
    'none',
    '–',
  ]);
  expect(await page.locator('nav a').getAttribute('href')).toBe('/visits.csv');
  const drawn = await page.locator('canvas').evaluateAll((all) =>
    all.map((canvas) => {
      const { width, height } = canvas as HTMLCanvasElement;
      const pixels = (canvas as HTMLCanvasElement)
        .getContext('2d')!
        .getImageData(0, 0, width, height).data;
      const blue = [0x2a, 0x78, 0xd6]; // the first curve's colour
      return pixels.some((_, i) => i % 4 === 0 && blue.every((c, k) => pixels[i + k] === c));
    }),
  );
  expect(drawn).toEqual([true, true, true]);
  await keep_screenshot(page, 'charts');
  expect(requests).toEqual([pathToFileURL(file).href]);
  expect(errors).toEqual([]);
});

it('asks the server for the document of its address', async () => {
  const asked: string[] = [];
  const server = createServer((request, response) => {
    asked.push(request.url ?? '');
    if (!request.url?.startsWith('/visits')) {
      response.writeHead(404).end();
    } else if (request.url.startsWith('/visits.json')) {
      response.writeHead(200, { 'content-type': 'application/json' }).end(JSON.stringify(shown));
    } else {
      response.writeHead(200, { 'content-type': 'text/html' }).end(page_text);
    }
  });
  clean_up(() => {
    server.closeAllConnections();
    server.close();
  });
  await new Promise<void>((resolve) => server.listen(0, '127.0.0.1', resolve));
  const address = server.address();
  if (address === null || typeof address === 'string') throw new Error('no port');
  const { page } = await new_page();
  await page.goto(`http://127.0.0.1:${address.port}/visits?days=7&scene=hall`);
  await expect.poll(() => page.title()).toBe('A run');
  expect(asked).toContain('/visits.json?days=7&scene=hall');
});
