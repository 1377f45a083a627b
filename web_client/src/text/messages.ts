// Message catalogues: texts with values in braces, such as "{n} of {count}", and their plural forms. Pure.

/** A catalogue as translators write it. An object with `other` holds the plural forms of one text. */
export interface Catalogue {
  readonly [key: string]: string | Catalogue;
}

/**
 * Plural forms by the categories of Intl.PluralRules, or "=0" for exactly that number. `count` in the values
 * chooses the form.
 */
interface Plural {
  readonly other: string;
}

/** The names in braces. */
type Names<T extends string> = T extends `${string}{${infer Name}}${infer Rest}`
  ? Name | Names<Rest>
  : never;

type Values<T extends string> = Readonly<Record<Names<T>, string | number>>;

type Message<T extends string> = [Names<T>] extends [never]
  ? string
  : (values: Values<T>) => string;

/** The texts of a catalogue. A text with values is a function of them. */
export type Messages<T> = {
  readonly [K in keyof T]: T[K] extends string
    ? Message<T[K]>
    : T[K] extends Plural
      ? (values: Values<T[K][keyof T[K]] & string> & { readonly count: number }) => string
      : Messages<T[K]>;
};

/** `language`: of the catalogue. `locale`: in which numbers are written. */
export function messages<T extends Catalogue>(
  catalogue: T,
  language: string,
  locale: string,
): Messages<T> {
  const rules = new Intl.PluralRules(language);
  const numbers = new Intl.NumberFormat(locale);
  type Given = Readonly<Record<string, string | number>>;

  const fill = (form: string, values: Given): string =>
    form.replace(/\{(\w+)\}/g, (_, name: string) => {
      const value = values[name] ?? '';
      return typeof value === 'number' ? numbers.format(value) : value;
    });

  const message_of = (node: string | Catalogue): unknown => {
    if (typeof node === 'string')
      return node.includes('{') ? (values: Given) => fill(node, values) : node;
    const { other } = node;
    if (typeof other !== 'string') return messages_of(node);
    const forms = node as Readonly<Record<string, string>>;
    return (values: Given) => {
      const count = Number(values['count']);
      return fill(forms[`=${count}`] ?? forms[rules.select(count)] ?? other, values);
    };
  };

  const messages_of = (group: Catalogue): unknown =>
    Object.fromEntries(Object.entries(group).map(([key, node]) => [key, message_of(node)]));

  return messages_of(catalogue) as Messages<T>;
}
