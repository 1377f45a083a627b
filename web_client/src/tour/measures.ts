// Measures that sidecars and links hold: lines through marks, with names. Pure.
import { forward, length, normalize, short_coordinate } from '../base/vector';
import type { Mark } from '../measure/measurement';
import { in_language, write_translations } from '../text/translations';
import { JsonField } from './json_field';
import { max_linked_marks, max_linked_measures, max_marks, max_measures } from './limits';
import { read_words } from './tour';
import { untranslated, type Worded } from './words';

export interface Measure extends Worded {
  readonly marks: readonly Mark[];
}

interface ReadMeasures {
  readonly measures: readonly Measure[];
  /** What is wrong with the others. */
  readonly problems: readonly string[];
}

/** The measure is complete: it has a length. */
export const has_length = ({ marks }: Measure): boolean => marks.length >= 2;

/** As files and links have it. Lengths are in world units and two standard deviations. */
interface WrittenMark {
  readonly position: readonly number[];
  /** In all directions. */
  readonly error: number;
  /** Along the ray that found it. */
  readonly depth: readonly number[];
}

/** Seven digits for a position in a file; an error needs two. `digits`: of positions. */
const write_mark = ({ point, direction, along, across }: Mark, digits: number): WrittenMark => {
  const two_digits = (v: number): number => Number((2 * v).toPrecision(2));
  return {
    position: point.map((v) => short_coordinate(v, digits)),
    error: two_digits(across),
    depth: direction.map((v) => two_digits(v * along)),
  };
};

function read_mark(mark: JsonField): Mark {
  const across = (mark.find('error')?.number(0) ?? 0) / 2;
  const depth = mark.find('depth')?.vec3();
  return {
    point: mark.at('position').vec3(),
    direction: normalize(depth ?? forward, forward),
    along: depth ? length(depth) / 2 : across,
    across,
  };
}

function read_measure(measure: JsonField): Measure {
  return {
    title: measure.find('title')?.text() ?? '',
    ...read_words(measure),
    marks: measure.at('marks').at_least(2).elements(max_marks).map(read_mark),
  };
}

/** Those that can be read: a mistake in one does not hide the others. */
function read_each(list: JsonField, most: number): ReadMeasures {
  const measures: Measure[] = [];
  const problems: string[] = [];
  const attempt = (read: () => void): void => {
    try {
      read();
    } catch (error) {
      problems.push(error instanceof Error ? error.message : String(error));
    }
  };
  attempt(() => {
    for (const measure of list.elements(most)) attempt(() => measures.push(read_measure(measure)));
  });
  return { measures, problems };
}

/** Reads `measures` of a sidecar (TOURS.md). */
export const read_measures = (document: unknown): ReadMeasures =>
  read_each(new JsonField('measures', document ?? []), max_measures);

/** The measures as a visitor reads them, in the first of these languages that each title has. */
export const measures_for = (
  measures: readonly Measure[],
  readers: readonly string[],
): readonly Measure[] => measures.map((measure) => in_language(measure, readers));

/** Writes what read_measures() reads. */
export const write_measures = (measures: readonly Measure[]): unknown[] =>
  measures.filter(has_length).map(({ title, translations, marks }) => ({
    ...(title && { title }),
    ...write_translations(translations),
    marks: marks.map((mark) => write_mark(mark, 7)),
  }));

/** The first measures, as many as a link has room for. */
function measures_for_link(measures: readonly Measure[]): readonly Measure[] {
  let marks = 0;
  return measures
    .filter(has_length)
    .slice(0, max_linked_measures)
    .filter((measure) => (marks += measure.marks.length) <= max_linked_marks);
}

/** `x,y,z,error,dx,dy,dz` for each mark; d: depth. */
const numbers_of = ({ marks }: Measure): string =>
  marks
    .map((mark) => {
      const { position, error, depth } = write_mark(mark, 6);
      return [...position, error, ...depth].join(',');
    })
    .join(',');

/** Adds `measure=numbers~title` for each measure. */
export function add_to_link(fragment: URLSearchParams, measures: readonly Measure[]): void {
  for (const measure of measures_for_link(measures)) {
    const { title } = measure;
    fragment.append('measure', numbers_of(measure) + (title && `~${title}`));
  }
}

/** Those that are not among the others, whatever their names. */
export function without(measures: readonly Measure[], others: readonly Measure[]): Measure[] {
  const known = new Set(others.map(numbers_of));
  return measures.filter((measure) => !known.has(numbers_of(measure)));
}

/** Reads what add_to_link() writes. */
export function measures_of_link(page_url: string): ReadMeasures {
  const written = new URLSearchParams(new URL(page_url).hash.slice(1)).getAll('measure');
  const list = written.map((text) => {
    const [numbers, ...title] = text.split('~');
    const values = numbers!.split(',').map((part) => (part.trim() === '' ? NaN : Number(part)));
    const marks = Array.from({ length: Math.ceil(values.length / of_mark) }, (_, i) => {
      const [x, y, z, error = NaN, ...depth] = values.slice(of_mark * i, of_mark * (i + 1));
      return { position: [x, y, z], error, depth };
    });
    return { title: title.join('~').slice(0, max_title), marks };
  });
  return read_each(new JsonField('measure', list), max_linked_measures);
}
const max_title = 200;
const of_mark = 7; // numbers

/** A new one, in one language that nobody named. */
export const measure_of = (marks: readonly Mark[]): Measure => ({
  title: '',
  ...untranslated,
  marks,
});
