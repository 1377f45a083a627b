// Limits of a scene's tours. render_core/scene/files/tour_check.cpp has the same; tests/web_client/tours.test.ts compares them.
export const max_tours = 32;
export const max_stops = 256;
export const max_languages = 32;
export const max_media = 8; // of a stop
export const max_measures = 64;
export const max_marks = 100; // of a measure
export const max_linked_measures = 16;
export const max_linked_marks = 200; // of all measures that the page writes into a link
export const max_media_bytes = 64 << 20; // of a file
export const longest_stay_s = 3600;
export const longest_flight_s = 120;
export const max_text_characters = 4000;
export const max_sidecar_bytes = 1 << 20;
