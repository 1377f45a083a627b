import { load_part } from '../base/load_part';
import type { PageParts } from '../page/parts';
import { factor } from '../text/number';
import { text } from '../text/text';
import type { MeasureList } from '../tour/measure_list';
import { QualityPanel } from './quality_panel';
import type { StatsFact, StatsPanel } from './stats_panel';
import type { StreamSize } from './stream_size';

/** The panels of the toolbar that have no feature of their own. `set_scale`: as in MeasurePanel. */
export function mount_panels(
  parts: PageParts,
  stream_size: StreamSize,
  measures: MeasureList,
  set_scale: ((metres_per_unit: number) => void) | undefined,
): void {
  const { navigation, notice, worker, storage } = parts;
  new QualityPanel(navigation, stream_size, worker, storage);
  mount_statistics(parts);
  mount_measuring(parts, measures, set_scale);
  mount_views(parts, measures);
  navigation.speed_chosen.listen((speed) =>
    notice.show(text.quality.speed_now({ factor: factor(speed) }), 2),
  );
}

/** Returns what loads a part once. The next call tries again after a failure. */
function loads_once(load: () => Promise<unknown>): () => void {
  let is_asked = false;
  return () => {
    if (is_asked) return;
    is_asked = true;
    load().catch((error: unknown) => {
      is_asked = false;
      console.warn('a panel cannot be used', error); // the server is away
    });
  };
}

/** The statistics load when somebody opens their panel. They show facts that the worker has told before. */
function mount_statistics({ worker, toolbar }: PageParts): void {
  const facts = new Map<string, StatsFact>();
  let statistics: StatsPanel | undefined;
  const learn = (fact: StatsFact): void => {
    facts.set(fact.kind, fact);
    statistics?.learn(fact);
  };
  for (const kind of ['welcome', 'config', 'presenter'] as const) worker.on(kind, learn);
  const load = loads_once(async () => {
    const { StatsPanel } = await load_part(() => import('./stats_panel'));
    statistics = new StatsPanel(worker, toolbar);
    for (const fact of facts.values()) statistics.learn(fact);
  });
  toolbar.panel_shown.listen(({ panel, shown }) => {
    if (panel === 'stats' && shown) load();
  });
}

/** Plan and section load when somebody opens their panel, or when a link or a stop has an orthographic view. */
function mount_views(parts: PageParts, measures: MeasureList): void {
  const load = loads_once(async () => {
    const { ViewsPanel } = await load_part(() => import('./views_panel'));
    new ViewsPanel({ ...parts, measures });
  });
  parts.toolbar.panel_shown.listen(({ panel, shown }) => {
    if (panel === 'views' && shown) load();
  });
  parts.navigation.sampled.listen(({ eye }) => {
    if (eye.view_height !== undefined) load();
  });
}

/** Measuring loads when somebody opens its panel, or when there are measures of a link. */
function mount_measuring(
  parts: PageParts,
  measures: MeasureList,
  set_scale: ((metres_per_unit: number) => void) | undefined,
): void {
  const load = loads_once(async () => {
    const { MeasurePanel } = await load_part(() => import('./measure_panel'));
    new MeasurePanel({ ...parts, measures, set_scale });
  });
  parts.toolbar.panel_shown.listen(({ panel, shown }) => {
    if (panel === 'measure' && shown) load();
  });
  measures.changed.listen(() => {
    if (measures.own.length > 0) load();
  });
}
