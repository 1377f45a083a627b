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

interface Row {
  readonly label: string;
  readonly title?: string;
  readonly text: (stats: StatsSnapshot) => string;
  readonly plot?: (stats: StatsSnapshot) => number;
}

const number = (v: number, digits = 0): string => (Number.isFinite(v) ? v.toFixed(digits) : '–');

const rows: readonly Row[] = [
  {
    label: 'Shown',
    text: (s) => `${number(s.fps_shown, 1)} fps`,
    plot: (s) => s.fps_shown,
  },
  {
    label: 'Motion to photon',
    title: 'From a camera sample to its picture on the canvas: median / 95th percentile',
    text: (s) => `${number(s.motion_to_photon_ms.p50)} / ${number(s.motion_to_photon_ms.p95)} ms`,
    plot: (s) => s.motion_to_photon_ms.p50,
  },
  {
    label: 'Pose age',
    title: 'How old the camera behind the picture is while moving: median / 95th percentile',
    text: (s) => `${number(s.pose_age_ms.p50)} / ${number(s.pose_age_ms.p95)} ms`,
    plot: (s) => s.pose_age_ms.p95,
  },
  {
    label: 'Bitrate',
    text: (s) => `${number(s.bitrate_kbps / 1000, 2)} Mb/s`,
    plot: (s) => s.bitrate_kbps,
  },
  {
    label: 'Server',
    title: 'Mean time per frame: waiting + rendering + encoding + sending',
    text: ({ stages_ms: t }) =>
      [t.wait, t.render, t.encode, t.send].map((v) => number(v)).join(' + ') + ' ms',
  },
  {
    label: 'Client',
    title: 'Mean time per frame: decoding + waiting for the display',
    text: ({ stages_ms: t }) => `${number(t.decode, 1)} + ${number(t.present, 1)} ms`,
  },
  { label: 'Picture', text: (s) => `${s.width_px} × ${s.height_px}` },
  {
    label: 'Drops',
    title: 'Frames that arrived and were never shown; packets that the server never sent',
    text: (s) => `${s.frames_dropped} here, ${s.packets_dropped} at the server`,
  },
];

/** The statistics overlay. Reads nothing and draws nothing while it is hidden. */
export class StatsPanel {
  private readonly values_: HTMLElement[] = [];
  private readonly plots_ = new Map<Row, { canvas: HTMLCanvasElement; history: number[] }>();
  private readonly facts_: Record<keyof Facts, HTMLElement>;

  constructor() {
    const list = document.createElement('dl');
    for (const row of rows) {
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
    rows.forEach((row, i) => {
      this.values_[i]!.textContent = row.text(stats);
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
