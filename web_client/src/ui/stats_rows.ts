// Texts of the statistics overlay. Pure.
import { stages, type Stage, type StatsReport, type StatsSnapshot } from '../stats/metrics';
import { text } from '../text';

interface Row {
  readonly label: string;
  readonly title?: string;
  readonly text: (stats: StatsSnapshot) => string;
  readonly stage?: Stage;
}

const nothing = '–';

/** Formats with `digits` decimals. Gives one dash for all values when one of them was not measured. */
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

/** The stage that takes most of a frame's time; undefined before a measurement. */
export function slowest_stage(stages_ms: StatsSnapshot['stages_ms']): Stage | undefined {
  return stages.filter((stage) => stages_ms[stage] > 0).sort((a, b) => stages_ms[b] - stages_ms[a])[0];
}

/** Gives a dash before the first picture. */
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
  ...stages.map(stage_row),
  { label: text.stats.picture, text: once_shown((s) => `${s.width_px} × ${s.height_px}`) },
  {
    label: text.stats.detail,
    title: text.stats.detail_title,
    text: ({ pages: p }) =>
      p === undefined
        ? nothing
        : text.stats.detail_value(
            Math.max(p.detail_px, p.coarsest_px),
            p.gaussians,
            [p.finest_level, p.coarsest_level],
            p.missing_pages,
          ),
  },
  {
    label: text.stats.drops,
    title: text.stats.drops_title,
    text: once_shown((s) => text.stats.drops_value(s.frames_dropped, s.packets_dropped)),
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
  return Number.isFinite(last_motion.stages_ms.render) ? text.stats.at_rest : text.stats.not_moved;
}
