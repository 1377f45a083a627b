// Ends what tests have started, however they ended: what a test started with it, all else with its file.

const actions: (() => unknown)[] = [];
let of_file = 0; // how many of them

/** Runs the action after the test, or after the last one. What was started last ends first. */
export const clean_up = (action: () => unknown): number => actions.push(action);

export function begin_test(): void {
  of_file = actions.length;
}

export const end_test = (): Promise<void> => end_from(of_file);
export const end_file = (): Promise<void> => end_from(0);

async function end_from(first: number): Promise<void> {
  for (const action of actions.splice(first).reverse()) {
    await Promise.resolve()
      .then(action)
      .catch((error: unknown) => console.warn('not cleaned up', error));
  }
}
