// Which key an event means.

type Key = Pick<KeyboardEvent, 'code' | 'key'>;

/** By its position (KeyboardEvent.code). Assistive tools and remote controls send none, so their letter counts. */
export function position_of({ code, key }: Key): string {
  if (code && code !== 'Unidentified') return code;
  if (key === ' ') return 'Space';
  return /^[a-z]$/i.test(key) ? `Key${key.toUpperCase()}` : key;
}

/** By what is printed on it. Keyboards of other scripts have the Latin letter as well, at its usual position. */
export function letter_of({ code, key }: Key): string {
  if (/^[a-z]$/i.test(key)) return key.toUpperCase();
  const printed = /^Key([A-Z])$/.exec(code)?.[1];
  return printed && /^\p{L}/u.test(key) ? printed : key;
}

/** Whether a key is ours, and neither a form field's nor a shortcut of the browser. */
export function is_for_page(event: KeyboardEvent): boolean {
  const { ctrlKey, metaKey, altKey, isComposing, target } = event;
  const is_typing = target instanceof HTMLElement && target.matches('input, select, textarea');
  return !ctrlKey && !metaKey && !altKey && !isComposing && !is_typing;
}
