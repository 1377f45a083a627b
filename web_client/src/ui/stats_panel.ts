import type { StatsSnapshot } from '../stats/metrics';
import { by_id } from './dom';

/** What the server said of itself, and how this page shows pictures. */
export interface Facts {
  readonly renderer: string;
  readonly encoder: string;
  readonly presenter: string;
  readonly server_version: string;
}

const history_length = 72;

type Stage = keyof StatsSnapshot['stages_ms'];

interface Row {
  readonly label: string;
  readonly title?: string;
  readonly text: (stats: StatsSnapshot) => string;
  readonly plot?: (stats: StatsSnapshot) => number;
  readonly stage?: Stage;
}

const nothing = '–';

/** `digits` behind the point, and one dash for all values when one was not measured. */
function measured(values: readonly number[], digits: number, unit: string): string {
  if (!values.every(Number.isFinite)) return nothing;
  return `${values.map((v) => v.toFixed(digits)).join(' / ')} ${unit}`;
}

const stage_row = (stage: Stage, label: string, title: string): Row => ({
  label,
  title: `Mean time per frame: ${title}`,
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

export const stats_rows: readonly Row[] = [
  {
    label: 'Shown',
    text: (s) => (s.frames_shown > 0 ? measured([s.fps_shown], 1, 'fps') : nothing),
    plot: (s) => s.fps_shown,
  },
  {
    label: 'Motion to photon',
    title: 'From a camera sample to its picture on the canvas: median / 95th percentile',
    text: ({ motion_to_photon_ms: t }) => measured([t.p50, t.p95], 0, 'ms'),
    plot: (s) => s.motion_to_photon_ms.p50,
  },
  {
    label: 'Pose age',
    title: 'How old the camera behind the picture is while moving: median / 95th percentile',
    text: ({ pose_age_ms: t }) => measured([t.p50, t.p95], 0, 'ms'),
    plot: (s) => s.pose_age_ms.p95,
  },
  {
    label: 'Bitrate',
    text: (s) => (s.frames_shown > 0 ? measured([s.bitrate_kbps / 1000], 2, 'Mb/s') : nothing),
    plot: (s) => s.bitrate_kbps,
  },
  stage_row('wait', 'Wait', 'the server has the camera and no turn yet'),
  stage_row('render', 'Render', 'the server draws the picture'),
  stage_row('encode', 'Encode', 'the server compresses it'),
  stage_row('send', 'Send', 'the server waits for the network'),
  stage_row('decode', 'Decode', 'this browser decompresses it'),
  stage_row('present', 'Display', 'from decoded to drawn on the canvas'),
  {
    label: 'Picture',
    text: (s) => (s.frames_shown > 0 ? `${s.width_px} × ${s.height_px}` : nothing),
  },
  {
    label: 'Drops',
    title: 'Frames that arrived and were never shown; packets that the server never sent',
    text: (s) =>
      s.frames_shown > 0 ? `${s.frames_dropped} here, ${s.packets_dropped} at the server` : nothing,
  },
];

/** The statistics overlay. Reads nothing and draws nothing while it is hidden. */
export class StatsPanel {
  private readonly values_: HTMLElement[] = [];
  private readonly plots_ = new Map<Row, { canvas: HTMLCanvasElement; history: number[] }>();
  private readonly facts_: Record<keyof Facts, HTMLElement>;

  constructor() {
    const list = document.createElement('dl');
    for (const row of stats_rows) {
      const value = document.createElement('span');
      const cell = add_row(list, row.label, row.title);
      if (row.plot) {
        const canvas = document.createElement('canvas');
        canvas.width = history_length * 2;
        canvas.height = 34;
        canvas.setAttribute('aria-hidden', 'true');
        cell.append(canvas);
        this.plots_.set(row, { canvas, history: [] });
      }
      cell.append(value);
      this.values_.push(value);
    }
    const fact = (label: string): HTMLElement => {
      const cell = add_row(list, label);
      cell.className = 'reason';
      return cell;
    };
    this.facts_ = {
      renderer: fact('Renderer'),
      encoder: fact('Encoder'),
      presenter: fact('Presenter'),
      server_version: fact('Server version'),
    };
    by_id('stats-panel', HTMLElement).append(list);
  }

  show_facts(facts: Facts): void {
    for (const key of Object.keys(this.facts_) as (keyof Facts)[]) {
      this.facts_[key].textContent = facts[key];
    }
  }

  show(stats: StatsSnapshot): void {
    const slowest = slowest_stage(stats.stages_ms);
    stats_rows.forEach((row, i) => {
      const value = this.values_[i]!;
      value.textContent = row.text(stats);
      value.classList.toggle('slowest', row.stage !== undefined && row.stage === slowest);
      const plot = this.plots_.get(row);
      if (!plot || !row.plot) return;
      plot.history.push(row.plot(stats));
      if (plot.history.length > history_length) plot.history.shift();
      draw_sparkline(plot.canvas, plot.history);
    });
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

/** From 0 to the largest value; gaps where nothing was measured. */
function draw_sparkline(canvas: HTMLCanvasElement, history: readonly number[]): void {
  const context = canvas.getContext('2d');
  if (!context) return;
  const { width, height } = canvas;
  const top = Math.max(...history.filter(Number.isFinite), 1e-9);
  context.clearRect(0, 0, width, height);
  context.strokeStyle = getComputedStyle(canvas).getPropertyValue('--accent');
  context.lineWidth = 2;
  context.beginPath();
  let pen_down = false;
  history.forEach((value, i) => {
    const x = ((i + history_length - history.length + 0.5) * width) / history_length;
    const y = height - 2 - (value / top) * (height - 4);
    if (!Number.isFinite(value)) pen_down = false;
    else if (pen_down) context.lineTo(x, y);
    else {
      context.moveTo(x, y);
      pen_down = true;
    }
  });
  context.stroke();
}
