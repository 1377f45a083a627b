// Ends what the tests of a file have started, however they ended.

const actions: (() => unknown)[] = [];

/** Runs the action after the last test of the file. What was started last ends first. */
export const clean_up = (action: () => unknown): number => actions.push(action);

export async function end_all(): Promise<void> {
  for (const action of actions.splice(0).reverse()) {
    await Promise.resolve()
      .then(action)
      .catch((error: unknown) => console.warn('not cleaned up', error));
  }
}
