// Texts of the statistics overlay. Pure.
import {
  stages,
  type GpuUse,
  type PagesDrawn,
  type Stage,
  type StatsReport,
  type StatsSnapshot,
} from '../stats/metrics';
import { decimals, number } from '../text/number';
import { operator } from '../text/operator';

interface Row {
  readonly label: string;
  readonly title?: string;
  readonly text: (stats: StatsSnapshot) => string;
  readonly stage?: Stage;
}

const { units, stats: words } = operator;
const nothing = '–';

/** Formats with `digits` decimals. Gives one dash for all values when one of them was not measured. */
function measured(values: readonly number[], digits: number, unit: string): string {
  if (!values.every(Number.isFinite)) return nothing;
  return `${values.map((v) => decimals(v, digits)).join(' / ')} ${unit}`;
}

const pixels = (count: number): string => number(count, { useGrouping: false });

function detail({
  detail_px,
  coarsest_px,
  gaussians,
  finest_level,
  coarsest_level,
  missing_pages,
}: PagesDrawn): string {
  const px = Math.max(detail_px, coarsest_px);
  const [finest, coarsest] = [number(finest_level), number(coarsest_level)];
  return [
    `${px < 100 ? decimals(px, 1) : `> ${number(100)}`} ${units.pixels}`,
    number(gaussians, { notation: 'compact', maximumFractionDigits: 2 }),
    finest === coarsest ? words.level({ level: finest }) : words.levels({ finest, coarsest }),
    ...(missing_pages === 0 ? [] : [words.pages_missing({ count: missing_pages })]),
  ].join(' · ');
}

function gpu({ frame_ms, frames_per_list, lists_left }: GpuUse): string {
  return [
    `${decimals(frame_ms, 2)} ${units.milliseconds}`,
    ...(frames_per_list > 1
      ? [words.frames_per_list({ count: decimals(frames_per_list, 1) })]
      : []),
    ...(lists_left > 0 ? [words.lists_left({ count: lists_left })] : []),
  ].join(' · ');
}

const stage_row = (stage: Stage): Row => ({
  label: operator.stages[stage].label,
  title: words.stage_title + operator.stages[stage].title,
  text: ({ stages_ms }) => measured([stages_ms[stage]], 1, units.milliseconds),
  stage,
});

/** The stage that takes most of a frame's time; undefined before a measurement. */
export function slowest_stage(stages_ms: StatsSnapshot['stages_ms']): Stage | undefined {
  return stages
    .filter((stage) => stages_ms[stage] > 0)
    .sort((a, b) => stages_ms[b] - stages_ms[a])[0];
}

/** Gives a dash before the first picture. */
const once_shown =
  (value: (stats: StatsSnapshot) => string) =>
  (stats: StatsSnapshot): string =>
    stats.frames_shown > 0 ? value(stats) : nothing;

export const stats_rows: readonly Row[] = [
  { label: words.shown, text: once_shown((s) => measured([s.fps_shown], 1, units.fps)) },
  {
    label: words.motion,
    title: words.motion_title,
    text: ({ motion_to_photon_ms: t }) => measured([t.p50, t.p95], 0, units.milliseconds),
  },
  {
    label: words.age,
    title: words.age_title,
    text: ({ pose_age_ms: t }) => measured([t.p50, t.p95], 0, units.milliseconds),
  },
  {
    label: words.bitrate,
    text: once_shown((s) => measured([s.bitrate_kbps / 1000], 2, units.megabits)),
  },
  ...stages.map(stage_row),
  {
    label: words.picture,
    text: once_shown((s) => `${pixels(s.width_px)} × ${pixels(s.height_px)}`),
  },
  {
    label: words.detail,
    title: words.detail_title,
    text: ({ pages }) => (pages === undefined ? nothing : detail(pages)),
  },
  {
    label: words.gpu,
    title: words.gpu_title,
    text: (stats) => (stats.gpu === undefined ? nothing : gpu(stats.gpu)),
  },
  {
    label: words.headset,
    title: words.headset_title,
    text: ({ headset_hz }) => (headset_hz ? measured([headset_hz], 1, units.fps) : nothing),
  },
  {
    label: words.drops,
    title: words.drops_title,
    text: once_shown((s) =>
      words.drops_value({ here: s.frames_dropped, server: s.packets_dropped }),
    ),
  },
];

/** Texts of the rows. Nothing is measured at rest, so rows keep the last measured values. */
export function row_texts(stats: StatsReport): { readonly text: string; readonly kept: boolean }[] {
  return stats_rows.map((row) => {
    const now = row.text(stats);
    if (now !== nothing) return { text: now, kept: false };
    const last = row.text({ ...stats, ...stats.last_motion });
    return { text: last, kept: last !== nothing };
  });
}

/** Says why some rows are paler or empty; empty while the camera moves. */
export function rest_note({ frames_shown, stages_ms, last_motion }: StatsReport): string {
  if (frames_shown === 0 || Number.isFinite(stages_ms.render)) return '';
  return Number.isFinite(last_motion.stages_ms.render) ? words.at_rest : words.not_moved;
}
