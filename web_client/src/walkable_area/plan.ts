// What the page loads for the floor plan.
export { house_around } from '../walk/dollhouse';
export { Dollhouse } from './dollhouse';
export { PlanPanel } from './plan_panel';
