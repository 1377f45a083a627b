// The tables of URLs: which row a request finds, how long its body may be and who may send it.

#include "server/routes.h"

#include "server/media/media_type.h"
#include "server/scenes/tours.h"
#include "tests/support/test.h"

namespace catgs::test {
namespace {

using enum HttpMethod;

struct Expected {
  HttpMethod method;
  std::string path;  // of a request
  std::size_t most_bytes;
  Right right;
};

/// Each request finds a row of its own, and no row is left over.
void expect_rows(std::span<const Route> table, const std::vector<Expected>& requests) {
  std::set<const Route*> found;
  for (const Expected& expected : requests) {
    const Route* route = find_route(table, expected.method, expected.path);
    ASSERT_NE(route, nullptr) << expected.path;
    EXPECT_EQ(route->method, expected.method) << expected.path;
    EXPECT_EQ(route->most_bytes, expected.most_bytes) << expected.path;
    EXPECT_EQ(route->right, expected.right) << expected.path;
    EXPECT_EQ(route->handler.answer == nullptr, expected.method == put) << expected.path;
    EXPECT_TRUE(found.insert(route).second) << expected.path << " finds " << route->path;
  }
  EXPECT_EQ(found.size(), table.size());
}

TEST(Routes, PublicUrlsHaveALimitAndARight) {
  expect_rows(public_routes(),
              {
                  {get, "/healthz", no_body, Right::none},
                  {get, "/readyz", no_body, Right::none},
                  {get, "/api/scenes", no_body, Right::none},
                  {get, "/api/scenes/hall/tours", no_body, Right::see_or_pass},
                  {get, "/api/scenes/hall/poster.jpg", no_body, Right::see},
                  {get, "/api/scenes/hall/walk", no_body, Right::see},
                  {get, "/api/scenes/hall/media-pass", no_body, Right::see},
                  {get, "/api/scenes/hall/media", no_body, Right::save},
                  {get, "/api/scenes/hall/media/a.jpg", no_body, Right::see_or_pass},
                  {put, "/api/scenes/hall/media/a.jpg", max_media_bytes, Right::save},
                  {put, "/api/scenes/hall/sidecar", max_sent_sidecar_bytes, Right::save},
                  {put, "/api/scenes/hall/films", max_upload_bytes, Right::save},
                  {get, "/api/films/12ab", no_body, Right::none},
                  {get, "/api/films/12ab/file", no_body, Right::none},
                  {put, "/api/films/12ab/cancel", max_sent_sidecar_bytes, Right::none},
                  {delete_, "/api/films/12ab", no_body, Right::none},
                  {get, "/visits", no_body, Right::none},
                  {get, "/visits.json", no_body, Right::none},
                  {get, "/", no_body, Right::none},
                  {get, "/index.html", no_body, Right::none},
                  {get, "/assets/page.js", no_body, Right::none},
              });
}

TEST(Routes, AdminUrlsTakeNoBodyAndNoToken) {
  std::vector<Expected> requests;
  for (const char* path : {"/healthz", "/readyz", "/metrics", "/api/metrics", "/api/sessions",
                           "/visits", "/visits.json", "/visits.csv", "/visits/stops.csv", "/other"})
    requests.push_back({get, path, no_body, Right::none});
  expect_rows(admin_routes(), requests);
}

TEST(Routes, OtherMethodsFindNoRow) {
  for (const char* path : {"/", "/api/scenes", "/api/scenes/hall/sidecar", "/api/films/12ab/file",
                           "/api/scenes/hall/media/a.jpg", "/api/films/", "/api/films/1/2"})
    EXPECT_EQ(find_route(public_routes(), delete_, path), nullptr) << path;
  for (const char* path : {"/", "/api/scenes", "/api/scenes//sidecar", "/api/scenes/hall/tours",
                           "/api/films/12ab", "/api/films//cancel"})
    EXPECT_EQ(find_route(public_routes(), put, path), nullptr) << path;
  for (const HttpMethod method : {put, delete_})
    EXPECT_EQ(find_route(admin_routes(), method, "/metrics"), nullptr);
}

TEST(Routes, MediaMayHaveTheNameOfAnotherUrl) {
  for (const char* name : {"sidecar", "films", ""}) {
    const std::string path = std::string("/api/scenes/hall/media/") + name;
    EXPECT_EQ(find_route(public_routes(), put, path)->most_bytes, max_media_bytes) << path;
  }
  for (const char* name : {"tours", "walk", "poster.jpg"}) {
    const std::string path = std::string("/api/scenes/hall/media/") + name;
    EXPECT_EQ(find_route(public_routes(), get, path)->right, Right::see_or_pass) << path;
  }
}

}  // namespace
}  // namespace catgs::test
