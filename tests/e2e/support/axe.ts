// axe-core in the page under test.
import { readFileSync } from 'node:fs';
import { createRequire } from 'node:module';
import type { AnyPage } from './camera';

const source = readFileSync(createRequire(import.meta.url).resolve('axe-core/axe.min.js'), 'utf8');

/** What axe-core finds wrong in the page, by all of its rules: the rule, and the first lines of each element. */
export async function barriers(page: AnyPage): Promise<string[]> {
  // By the debugger, because the page's own policy lets no foreign script in.
  if (!(await page.evaluate('"axe" in window'))) await page.evaluate(`(() => { ${source}\n})()`);
  return page.evaluate(async () => {
    const { axe } = window as unknown as { axe: typeof import('axe-core') };
    const { violations } = await axe.run(document, { resultTypes: ['violations'] });
    return violations.flatMap(({ id, help, nodes }) =>
      nodes.map(({ html }) => `${id} (${help}): ${html.slice(0, 160)}`),
    );
  });
}
