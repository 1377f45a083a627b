// A page of tables and plots from one JSON document. Reports of catgs-load and soak.py have the document
// inside the page. For the server's /visits it comes from the page's own address with ".json" added.
import uPlot from 'uplot';
import 'uplot/dist/uPlot.min.css';
import { browser_storage } from '../base/browser_storage';
import { AccessToken } from '../session/token';
import type { ChartDocument, Link, Plot, Table } from './chart_document';

/** For both light and dark pages. */
const colours = ['#2a78d6', '#d9640b', '#1a8a4c', '#8a3fc4', '#b8860b', '#0d8a94'];
const bound_colour = '#c8201e';
const height_px = 200;

function element(tag: string, ...children: (Node | string)[]): HTMLElement {
  const made = document.createElement(tag);
  made.append(...children);
  return made;
}

function link({ text, href }: Link): HTMLElement {
  const made = element('a', text);
  made.setAttribute('href', href);
  return made;
}

function cell(value: Table['rows'][number][number]): HTMLElement {
  if (value === null) return element('td', '–');
  if (typeof value === 'number') return element('td', String(Number(value.toPrecision(4))));
  return element('td', typeof value === 'string' ? value : link(value));
}

function table({ columns, rows }: Table): HTMLElement {
  const head = element('tr', ...columns.map((name) => element('th', name)));
  const body = rows.map((row) => element('tr', ...row.map(cell)));
  const wide = element('div', element('table', head, ...body));
  wide.className = 'wide';
  return wide;
}

function series({ curves, bars }: Plot): uPlot.Series[] {
  return curves.map((curve, i) => ({
    label: curve.name,
    stroke: curve.bound ? bound_colour : colours[i % colours.length]!,
    width: 1.5,
    dash: curve.bound ? [5, 4] : [],
    spanGaps: true,
    points: { show: false },
    ...(bars ? { paths: uPlot.paths.bars!({ size: [0.8] }), fill: colours[0]! } : {}),
  }));
}

function draw(plot: Plot, host: HTMLElement): void {
  const style = getComputedStyle(host);
  const axis = (more: uPlot.Axis): uPlot.Axis => ({
    stroke: style.getPropertyValue('--ink-soft'),
    grid: { stroke: style.getPropertyValue('--line'), width: 1 },
    ticks: { show: false },
    ...more,
  });
  const half_day_s = 43_200;
  // Each curve has an x of its own.
  const position = (x: number | string): number =>
    typeof x === 'number' ? x : Date.parse(x) / 1e3;
  const data = uPlot.join(plot.curves.map(({ x, y }) => [x.map(position), [...y]]));
  new uPlot(
    {
      title: plot.title,
      width: host.clientWidth,
      height: height_px,
      scales: {
        x: {
          time: plot.x === 'dates',
          ...(plot.x === 'log' ? { distr: 3 } : {}),
          ...(plot.bars
            ? {
                range: (_: uPlot, low: number, high: number) => [
                  low - half_day_s,
                  high + half_day_s,
                ],
              }
            : {}),
        },
        y: {
          range: (_, low, high) => [
            Math.min(plot.floor ?? 0, Math.max(0, low)),
            Math.max(high * 1.05, 1e-3),
          ],
        },
      },
      tzDate: (time_s) => uPlot.tzDate(new Date(1e3 * time_s), 'UTC'),
      axes: [axis({}), axis({ label: plot.unit, labelSize: 18 })],
      series: [{}, ...series(plot)],
    },
    data,
    host,
  );
}

function show({ title, facts, links = [], parts }: ChartDocument): void {
  document.title = title;
  document.body.append(
    element('h1', title),
    element('p', facts),
    element('nav', ...links.map(link)),
  );
  for (const part of parts) {
    document.body.append(element('h2', part.heading));
    if (part.table) document.body.append(table(part.table));
    const grid = element('div');
    grid.className = 'plots';
    document.body.append(grid);
    const hosts = (part.plots ?? []).map((plot) => ({ plot, host: element('div') }));
    grid.append(...hosts.map(({ host }) => host));
    for (const { plot, host } of hosts) draw(plot, host);
  }
}

/** The public port asks authors for the token of their link. */
async function load(): Promise<ChartDocument> {
  const inside = document.getElementById('document')?.textContent;
  if (inside) return JSON.parse(inside) as ChartDocument;
  const token = new AccessToken(location, history, browser_storage('sessionStorage')).value;
  const headers: Record<string, string> = token ? { 'catgs-token': token } : {};
  const answer = await fetch(`${location.pathname}.json${location.search}`, { headers });
  if (answer.status === 401) throw new Error('open it by an author link');
  if (!answer.ok) throw new Error(`the server answered ${answer.status}`);
  return (await answer.json()) as ChartDocument;
}

load().then(show, (error: unknown) => {
  document.body.append(element('p', `There is nothing to show: ${String(error)}.`));
});
