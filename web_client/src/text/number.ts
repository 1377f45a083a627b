// Numbers and times as the visitor writes them.
import { locale, text } from './text';

export const number = (value: number | bigint, options: Intl.NumberFormatOptions = {}): string =>
  new Intl.NumberFormat(locale, options).format(value);

/** With exactly so many decimals. */
export const decimals = (value: number, count: number): string =>
  number(value, { minimumFractionDigits: count, maximumFractionDigits: count });

/** "1.5×" */
export const factor = (value: number): string =>
  `${number(value, { maximumSignificantDigits: 2 })}×`;

/** "a, b and c" */
export const list = (items: readonly string[]): string => new Intl.ListFormat(locale).format(items);

/** A time to wait, to the second below 90 s and to the minute above. */
export function duration(seconds: number): string {
  if (seconds < 1) return text.moment;
  const [value, unit] = seconds < 90 ? [seconds, 'second'] : [seconds / 60, 'minute'];
  return number(Math.round(value), { style: 'unit', unit, unitDisplay: 'long' });
}
