import { make } from '../page/dom';
import { text } from '../text/text';
import type { Medium } from '../tour/media';

/** Shows a picture in the whole window, until the visitor closes it. */
export function show_large(address: string, { alt, language }: Medium): void {
  const close = make('button', { type: 'button', 'aria-label': text.media.close }, '×');
  const words = make('p', { dir: 'auto', lang: language }, alt);
  const dialog = make(
    'dialog',
    { id: 'large-picture', 'aria-label': alt },
    make('img', { src: address, alt: '' }),
    words,
    close,
  );
  close.addEventListener('click', () => dialog.close());
  dialog.addEventListener('click', ({ target }) => {
    if (target === dialog) dialog.close(); // beside the picture
  });
  dialog.addEventListener('keydown', (event) => event.stopPropagation()); // the page behind it rests
  dialog.addEventListener('close', () => dialog.remove());
  document.body.append(dialog);
  dialog.showModal();
}
