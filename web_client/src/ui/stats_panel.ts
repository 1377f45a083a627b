import { load_part } from '../base/load_part';
import { by_id, make, save_file } from '../page/dom';
import type { Toolbar } from '../page/toolbar';
import type { Sides } from '../present/warp';
import { StatsHistory } from '../stats/history';
import type { StatsReport } from '../stats/metrics';
import { number } from '../text/number';
import { operator } from '../text/operator';
import type { WorkerClient } from '../worker/client';
import type { FromWorker } from '../worker/messages';
import type { StatsCharts } from './stats_charts';
import { rest_note, row_texts, slowest_stage, stats_rows } from './stats_rows';

const interval_ms = 250;

/** Facts about the server, and how this page shows pictures. */
const facts = ['renderer', 'encoder', 'presenter', 'server_version'] as const;
type Facts = Readonly<Record<(typeof facts)[number], string>>;

/** What the worker tells once, or when it changes. */
export type StatsFact = Extract<FromWorker, { kind: 'welcome' | 'config' | 'presenter' }>;

/** The statistics overlay. Reads nothing and draws nothing while it is hidden. */
export class StatsPanel {
  private readonly values_: HTMLElement[] = [];
  private facts_: Facts = { renderer: '', encoder: '', presenter: '', server_version: '' };
  private readonly history_ = new StatsHistory();
  private readonly rest_ = make('p', { hidden: true });
  private readonly plots_ = make('div', { className: 'plots' });
  private readonly about_ = make('dl');
  private charts_: StatsCharts | undefined;
  private opened_ = false;
  private timer_: ReturnType<typeof setInterval> | undefined;

  constructor(
    private readonly worker_: WorkerClient,
    toolbar: Toolbar,
  ) {
    const list = make('dl');
    for (const { label, title } of stats_rows) {
      const value = make('span', { dir: 'auto' });
      list.append(make('dt', { title: title ?? '' }, label), make('dd', {}, value));
      this.values_.push(value);
    }
    const save = make(
      'button',
      { type: 'button', onclick: () => this.save() },
      operator.stats.save,
    );
    const in_english = make(
      'div',
      { lang: 'en', dir: 'ltr' },
      this.rest_,
      list,
      this.plots_,
      this.about_,
      save,
    );
    const overlay = by_id('stats-panel', HTMLElement);
    overlay.append(in_english);
    toolbar.panel_shown.listen(({ panel, shown }) => {
      if (panel === 'stats') this.watch(shown);
    });
    this.watch(!overlay.hidden);
  }

  learn(fact: StatsFact): void {
    this.facts_ = { ...this.facts_, ...facts_in(fact) };
    this.about_.replaceChildren(
      ...facts.flatMap((fact) => [
        make('dt', {}, operator.stats[fact]),
        make('dd', { className: 'reason', dir: 'auto' }, this.facts_[fact]),
      ]),
    );
  }

  private watch(shown: boolean): void {
    clearInterval(this.timer_);
    if (!shown) return;
    const show = (): void => void this.worker_.stats().then((stats) => this.show(stats));
    show();
    this.timer_ = setInterval(show, interval_ms);
  }

  private show(report: StatsReport): void {
    const { last_motion, ...stats } = report; // earlier samples of the history have it
    this.history_.add(stats, performance.now());
    const note = rest_note(report);
    this.rest_.hidden = note === '';
    if (this.rest_.textContent !== note) this.rest_.textContent = note;
    const slowest = slowest_stage((note === '' ? stats : last_motion).stages_ms);
    row_texts(report).forEach(({ text: value, kept }, i) => {
      const cell = this.values_[i]!;
      cell.textContent = value;
      cell.classList.toggle('kept', kept);
      const { stage } = stats_rows[i]!;
      cell.classList.toggle('slowest', stage !== undefined && stage === slowest);
    });
    this.charts_?.show(this.history_);
    if (!this.opened_) void this.load_charts();
  }

  /** Loads the plots on first use, because most visitors never look. */
  private async load_charts(): Promise<void> {
    this.opened_ = true;
    try {
      const { StatsCharts } = await load_part(() => import('./stats_charts'));
      this.charts_ = new StatsCharts(this.plots_);
      this.charts_.show(this.history_);
    } catch (error) {
      console.warn('the plots could not be loaded', error); // the server is away
      this.opened_ = false;
    }
  }

  private save(): void {
    const json = this.history_.to_json(this.facts_, new Date().toISOString());
    save_file(new Blob([json], { type: 'application/json' }), 'catgs-statistics.json');
  }
}

function facts_in(fact: StatsFact): Partial<Facts> {
  if (fact.kind === 'config') return { encoder: fact.config.encoder };
  if (fact.kind === 'welcome')
    return { renderer: fact.welcome.renderer, server_version: fact.welcome.serverVersion };
  const { presenter, warp, overscan } = fact;
  return {
    presenter: `${operator.presenters[presenter]} · ${operator.warp[warp]}${overscan_text(overscan)}`,
  };
}

/** Shares of the view by which pictures are larger; empty where they are not. */
function overscan_text({ x, y }: Sides): string {
  const percent = (side: number): string => number(side - 1, { style: 'percent' });
  return x === 1 && y === 1
    ? ''
    : ` · ${operator.warp.overscan({ width: percent(x), height: percent(y) })}`;
}
