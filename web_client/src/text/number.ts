// Numbers and times as the visitor writes them.
import { locale, text } from './text';

export const number = (value: number | bigint, options: Intl.NumberFormatOptions = {}): string =>
  new Intl.NumberFormat(locale, options).format(value);

/**
 * The number that people wrote; undefined where it is none. A comma or a point alone begins the decimals, whatever
 * the language. Groups of thousands and the digits of Arabic and East Asian keyboards are understood.
 */
export function read_number(written: string): number | undefined {
  const plain = written
    .replace(/[٠-٩۰-۹０-９]/g, (digit) => String(digit.codePointAt(0)! & 15))
    .replace(/[\s'’٬]/g, '')
    .replace(/[٫．]/g, '.')
    .replace('，', ',')
    .replace(/^−/, '-');
  const in_groups =
    /^[+-]?\d{1,3}(?:,\d{3})+(?:,\d{3}|\.\d+)$|^[+-]?\d{1,3}(?:\.\d{3})+(?:\.\d{3}|,\d+)$/;
  if (in_groups.test(plain)) {
    const last = plain.match(/[.,]/g)!;
    const decimal = last[0] === last.at(-1) ? undefined : last.at(-1);
    return Number(plain.replaceAll(last[0], '').replace(decimal ?? '.', '.'));
  }
  return /^[+-]?(?:\d+[.,]?\d*|[.,]\d+)$/.test(plain) ? Number(plain.replace(',', '.')) : undefined;
}

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
