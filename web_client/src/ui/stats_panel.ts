import { StatsHistory } from '../stats/history';
import type { StatsReport, StatsSnapshot } from '../stats/metrics';
import { text } from '../text';
import { by_id } from './dom';
import { save_file } from './share_panel';
import type { StatsCharts } from './stats_charts';

/** What the server said of itself, and how this page shows pictures. */
export interface Facts {
  readonly renderer: string;
  readonly encoder: string;
  readonly presenter: string;
  readonly server_version: string;
}

type Stage = keyof StatsSnapshot['stages_ms'];

interface Row {
  readonly label: string;
  readonly title?: string;
  readonly text: (stats: StatsSnapshot) => string;
  readonly stage?: Stage;
}

const nothing = '–';

/** `digits` behind the point, and one dash for all values when one was not measured. */
function measured(values: readonly number[], digits: number, unit: string): string {
  if (!values.every(Number.isFinite)) return nothing;
  return `${values.map((v) => v.toFixed(digits)).join(' / ')} ${unit}`;
}

const stage_row = (stage: Stage): Row => ({
  label: text.stages[stage].label,
  title: text.stats.stage_title + text.stages[stage].title,
  text: ({ stages_ms }) => measured([stages_ms[stage]], 1, 'ms'),
  stage,
});

/** Where most of a frame's time goes; undefined before anything was measured. */
export function slowest_stage(stages_ms: StatsSnapshot['stages_ms']): Stage | undefined {
  const stages = Object.keys(stages_ms) as Stage[];
  return stages
    .filter((stage) => stages_ms[stage] > 0)
    .sort((a, b) => stages_ms[b] - stages_ms[a])[0];
}

/** A dash before anything was shown. */
const once_shown =
  (value: (stats: StatsSnapshot) => string) =>
  (stats: StatsSnapshot): string =>
    stats.frames_shown > 0 ? value(stats) : nothing;

export const stats_rows: readonly Row[] = [
  { label: text.stats.shown, text: once_shown((s) => measured([s.fps_shown], 1, 'fps')) },
  {
    label: text.stats.motion,
    title: text.stats.motion_title,
    text: ({ motion_to_photon_ms: t }) => measured([t.p50, t.p95], 0, 'ms'),
  },
  {
    label: text.stats.age,
    title: text.stats.age_title,
    text: ({ pose_age_ms: t }) => measured([t.p50, t.p95], 0, 'ms'),
  },
  {
    label: text.stats.bitrate,
    text: once_shown((s) => measured([s.bitrate_kbps / 1000], 2, 'Mb/s')),
  },
  ...(Object.keys(text.stages) as Stage[]).map(stage_row),
  { label: text.stats.picture, text: once_shown((s) => `${s.width_px} × ${s.height_px}`) },
  {
    label: text.stats.window,
    title: text.stats.window_title,
    text: ({ window, sub_share }) =>
      Number.isFinite(window) ? `${window.toFixed(1)}, ${Math.round(sub_share * 100)} %` : nothing,
  },
  {
    label: text.stats.drops,
    title: text.stats.drops_title,
    text: once_shown((s) => text.stats.drops_value(s.frames_dropped, s.packets_dropped)),
  },
];

/** What the rows say: at rest nothing is measured, and what was measured last stays to be read. */
export function row_texts(stats: StatsReport): { readonly text: string; readonly kept: boolean }[] {
  return stats_rows.map((row) => {
    const now = row.text(stats);
    if (now !== nothing) return { text: now, kept: false };
    const last = row.text({ ...stats, ...stats.last_motion });
    return { text: last, kept: last !== nothing };
  });
}

/** Why some rows are paler, or have nothing; empty while the camera moves. */
export function rest_note({ frames_shown, stages_ms, last_motion }: StatsReport): string {
  if (frames_shown === 0 || Number.isFinite(stages_ms.render)) return '';
  return Number.isFinite(last_motion.stages_ms.render) ? text.stats.at_rest : text.stats.not_moved;
}

/** The statistics overlay. Reads nothing and draws nothing while it is hidden. */
export class StatsPanel {
  private readonly values_: HTMLElement[] = [];
  private readonly facts_: Record<keyof Facts, HTMLElement>;
  private readonly history_ = new StatsHistory();
  private readonly rest_ = document.createElement('p');
  private readonly plots_ = document.createElement('div');
  private charts_: StatsCharts | undefined;
  private shown_facts_: Facts | undefined;
  private opened_ = false;

  constructor() {
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
    this.facts_ = {
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
  }

  show_facts(facts: Facts): void {
    this.shown_facts_ = facts;
    for (const key of Object.keys(this.facts_) as (keyof Facts)[]) {
      this.facts_[key].textContent = facts[key];
    }
  }

  show(report: StatsReport): void {
    const { last_motion, ...stats } = report; // an earlier sample of the history has that
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

  /** Most visitors never look: the plots come when somebody does. */
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
    const json = this.history_.to_json(this.shown_facts_ ?? {}, new Date().toISOString());
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
