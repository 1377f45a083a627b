/** The element of index.html with this id. Throws where index.html lacks it. */
export function by_id<T extends HTMLElement>(id: string, type: new () => T): T {
  const element = document.getElementById(id);
  if (!(element instanceof type)) throw new Error(`index.html has no ${type.name} #${id}`);
  return element;
}

type Attributes = Readonly<Record<`aria-${string}`, string>>;

/** Makes an element. ARIA goes by attributes, because Firefox has properties for it since version 119 only. */
export function make<K extends keyof HTMLElementTagNameMap>(
  tag: K,
  properties: Partial<HTMLElementTagNameMap[K]> & Attributes = {},
  ...children: (Node | string)[]
): HTMLElementTagNameMap[K] {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries<unknown>(properties)) {
    if (name.startsWith('aria-')) element.setAttribute(name, String(value));
    else Reflect.set(element, name, value);
  }
  element.append(...children);
  return element;
}

/** A drawing of index.html's `#icons`. */
export function icon(name: string): SVGSVGElement {
  const namespace = 'http://www.w3.org/2000/svg';
  const drawing = document.createElementNS(namespace, 'svg');
  const use = document.createElementNS(namespace, 'use');
  use.setAttribute('href', `#icon-${name}`);
  drawing.setAttribute('aria-hidden', 'true');
  drawing.append(use);
  return drawing;
}

export function on_click(id: string, action: () => void): void {
  by_id(id, HTMLButtonElement).addEventListener('click', action);
}

export function save_file(blob: Blob, name: string): void {
  const link = make('a', { href: URL.createObjectURL(blob), download: name });
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10_000);
}

/**
 * Lets the style sheets show that an element scrolls further, because phones show no scroll bars. Where it
 * holds nothing to reach by Tab, Tab reaches the element itself, so that keys can scroll it. Call the
 * returned function when its content has changed.
 */
export function hint_at_more(element: HTMLElement): () => void {
  const look = (): void => {
    const hidden_px = element.scrollHeight - element.clientHeight;
    element.classList.toggle('more-below', hidden_px - element.scrollTop > 1);
    if (hidden_px > 1 && !element.querySelector('button, input, select, textarea, a'))
      element.tabIndex = 0;
    else element.removeAttribute('tabindex');
  };
  element.addEventListener('scroll', look, { passive: true });
  new ResizeObserver(look).observe(element);
  return look;
}
