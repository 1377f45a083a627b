// What a page of charts shows. tests/load/chart_document.cpp, tests/load/soak_report.py and
// server/counts/visits_page.cpp write it.

export interface Link {
  readonly text: string;
  readonly href: string;
}

export interface Curve {
  readonly name: string;
  /** Numbers, or dates like 2026-11-27. */
  readonly x: readonly (number | string)[];
  readonly y: readonly (number | null)[];
  /** A value that must not be exceeded. */
  readonly bound?: boolean;
}

export interface Plot {
  readonly title: string;
  readonly unit: string;
  /** Where the y axis begins, unless a value is less; 0 without it. */
  readonly floor?: number;
  readonly curves: readonly Curve[];
  /** Linear without it. */
  readonly x?: 'log' | 'dates';
  readonly bars?: boolean;
}

export interface Table {
  readonly columns: readonly string[];
  readonly rows: readonly (readonly (string | number | Link | null)[])[];
}

export interface Part {
  readonly heading: string;
  readonly table?: Table;
  readonly plots?: readonly Plot[];
}

export interface ChartDocument {
  readonly title: string;
  readonly facts: string;
  readonly links?: readonly Link[];
  readonly parts: readonly Part[];
}
