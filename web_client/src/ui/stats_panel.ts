import { StatsHistory } from '../stats/history';
import type { StatsReport } from '../stats/metrics';
import { text } from '../text';
import type { WorkerClient } from '../worker/client';
import { by_id, save_file } from './dom';
import type { StatsCharts } from './stats_charts';
import { rest_note, row_texts, slowest_stage, stats_rows } from './stats_rows';
import type { Toolbar } from './toolbar';

const interval_ms = 250;

/** Facts about the server, and how this page shows pictures. */
interface Facts {
  readonly renderer: string;
  readonly encoder: string;
  readonly presenter: string;
  readonly server_version: string;
}

/** The statistics overlay. Reads nothing and draws nothing while it is hidden. */
export class StatsPanel {
  private readonly values_: HTMLElement[] = [];
  private readonly fact_cells_: Record<keyof Facts, HTMLElement>;
  private facts_: Facts = { renderer: '', encoder: '', presenter: '', server_version: '' };
  private readonly history_ = new StatsHistory();
  private readonly rest_ = document.createElement('p');
  private readonly plots_ = document.createElement('div');
  private charts_: StatsCharts | undefined;
  private opened_ = false;
  private timer_: ReturnType<typeof setInterval> | undefined;

  constructor(
    private readonly worker_: WorkerClient,
    toolbar: Toolbar,
  ) {
    const list = document.createElement('dl');
    for (const row of stats_rows) {
      const value = document.createElement('span');
      add_row(list, row.label, row.title).append(value);
      this.values_.push(value);
    }
    const about = document.createElement('dl');
    const fact = (label: string): HTMLElement => {
      const cell = add_row(about, label);
      cell.className = 'reason';
      return cell;
    };
    this.fact_cells_ = {
      renderer: fact(text.stats.renderer),
      encoder: fact(text.stats.encoder),
      presenter: fact(text.stats.presenter),
      server_version: fact(text.stats.server_version),
    };
    this.rest_.hidden = true;
    this.plots_.className = 'plots';
    const save = document.createElement('button');
    save.type = 'button';
    save.textContent = text.stats.save;
    save.addEventListener('click', () => this.save());
    by_id('stats-panel', HTMLElement).append(this.rest_, list, this.plots_, about, save);
    worker_.on('welcome', ({ welcome }) => {
      this.show_facts({ renderer: welcome.renderer, server_version: welcome.serverVersion });
    });
    worker_.on('config', ({ config }) => this.show_facts({ encoder: config.encoder }));
    worker_.on('presenter', ({ description }) => this.show_facts({ presenter: description }));
    toolbar.panel_shown.listen(({ panel, shown }) => {
      if (panel === 'stats') this.watch(shown);
    });
  }

  private show_facts(facts: Partial<Facts>): void {
    this.facts_ = { ...this.facts_, ...facts };
    for (const key of Object.keys(this.fact_cells_) as (keyof Facts)[]) {
      this.fact_cells_[key].textContent = this.facts_[key];
    }
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
      const { StatsCharts } = await import('./stats_charts');
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

function add_row(list: HTMLElement, label: string, title?: string): HTMLElement {
  const term = document.createElement('dt');
  term.textContent = label;
  if (title) term.title = title;
  const cell = document.createElement('dd');
  list.append(term, cell);
  return cell;
}
