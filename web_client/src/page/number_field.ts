// Fields for numbers that people type. Those of browsers (type=number) refuse the comma or the point of other languages.
import { number, read_number } from '../text/number';
import { text } from '../text/text';

/** The number in the field; undefined where it is empty, or where it is none in `low`…`high`, which the field then says. */
export function number_in(field: HTMLInputElement, low: number, high: number): number | undefined {
  const value = read_number(field.value);
  const fits = value !== undefined && value >= low && value <= high;
  const limit = (v: number): string => number(v, { maximumSignificantDigits: 3 });
  const wrong = text.page.number_between({ low: limit(low), high: limit(high) });
  field.setCustomValidity(fits || field.value.trim() === '' ? '' : wrong);
  return fits ? value : undefined;
}
