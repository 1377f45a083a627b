/** The element of index.html with this id. Throws where index.html lacks it. */
export function by_id<T extends HTMLElement>(id: string, type: new () => T): T {
  const element = document.getElementById(id);
  if (!(element instanceof type)) throw new Error(`index.html has no ${type.name} #${id}`);
  return element;
}

export function on_click(id: string, action: () => void): void {
  by_id(id, HTMLButtonElement).addEventListener('click', action);
}

export function save_file(blob: Blob, name: string): void {
  const link = document.createElement('a');
  link.href = URL.createObjectURL(blob);
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10_000);
}
