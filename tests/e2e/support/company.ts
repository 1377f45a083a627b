// One visitor leads others.
import type { Page } from 'playwright-core';

/** Presents as Ada. Returns the link for those who follow. */
export async function present(page: Page): Promise<string> {
  await page.getByRole('button', { name: 'Share' }).click();
  await page.getByLabel('Your name, for those who follow').fill('Ada');
  await page.getByRole('button', { name: 'Present', exact: true }).click();
  const link = await page.getByLabel('Link for those who follow').inputValue();
  await page.getByText('You lead. Nobody follows yet.').waitFor();
  return link;
}
