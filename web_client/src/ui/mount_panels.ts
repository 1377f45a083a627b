import type { PageParts } from '../page/parts';
import { factor } from '../text/number';
import { text } from '../text/text';
import type { MeasureList } from '../tour/measure_list';
import { QualityPanel } from './quality_panel';
import { StatsPanel } from './stats_panel';
import type { StreamSize } from './stream_size';

/** The panels of the toolbar that have no feature of their own. `set_scale`: as in MeasurePanel. */
export function mount_panels(
  parts: PageParts,
  stream_size: StreamSize,
  measures: MeasureList,
  set_scale: ((metres_per_unit: number) => void) | undefined,
): void {
  const { navigation, notice, worker, toolbar, storage } = parts;
  new QualityPanel(navigation, stream_size, worker, storage);
  new StatsPanel(worker, toolbar);
  mount_measuring(parts, measures, set_scale);
  navigation.speed_chosen.listen((speed) =>
    notice.show(text.quality.speed_now({ factor: factor(speed) }), 2),
  );
}

/** Measuring loads when somebody opens its panel, or when there are measures of a link. */
function mount_measuring(
  parts: PageParts,
  measures: MeasureList,
  set_scale: ((metres_per_unit: number) => void) | undefined,
): void {
  let is_asked = false;
  const load = (): void => {
    if (is_asked) return;
    is_asked = true;
    import('./measure_panel')
      .then(({ MeasurePanel }) => new MeasurePanel({ ...parts, measures, set_scale }))
      .catch((error: unknown) => {
        is_asked = false;
        console.warn('measuring cannot be used', error); // the server is away
      });
  };
  parts.toolbar.panel_shown.listen(({ panel, shown }) => {
    if (panel === 'measure' && shown) load();
  });
  measures.changed.listen(() => {
    if (measures.own.length > 0) load();
  });
}
