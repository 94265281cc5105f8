// Camera files, degenerate cameras, and the default orbit.

#include "core/view/camera.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <limits>
#include <string>

#include "core/base/error.hpp"
#include "tests/run_program.hpp"

namespace isowave::core {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

class CameraFileTest : public testing::Test {
 protected:
  std::filesystem::path write(const std::string &text) {
    std::ofstream(folder_ / "cameras.json", std::ios::binary) << text;
    return folder_ / "cameras.json";
  }

  /// The one line that reading `text` is refused with.
  std::string refusal(const std::string &text) {
    try {
      read_camera_file(write(text));
    } catch (const Error &error) {
      EXPECT_THAT(error.what(), AllOf(HasSubstr("cameras.json"), Not(HasSubstr("\n"))));
      return error.what();
    }
    return "accepted";
  }

  test::TemporaryFolder folder_;
};

TEST_F(CameraFileTest, ReadsEveryField) {
  const CameraFile file = read_camera_file(write(
      R"({"dims":[4,5,6],"spacing":[1,0.5,2],"width":640,"height":360,"fovy_deg":45.5,"cameras":[
               {"eye":[1,2,3],"at":[4,5,7],"up":[0,1,0]},
               {"eye":[-1e3,0,0],"at":[0,0,0],"up":[0,0,1]}]})"));
  EXPECT_EQ(file.dims, glm::uvec3(4, 5, 6));
  EXPECT_EQ(file.spacing, glm::dvec3(1, 0.5, 2));
  EXPECT_EQ(file.width, 640u);
  EXPECT_EQ(file.height, 360u);
  ASSERT_EQ(file.cameras.size(), 2u);
  EXPECT_EQ(file.cameras[0].eye, glm::dvec3(1, 2, 3));
  EXPECT_EQ(file.cameras[0].at, glm::dvec3(4, 5, 7));
  EXPECT_EQ(file.cameras[0].up, glm::dvec3(0, 1, 0));
  EXPECT_EQ(file.cameras[0].fovy_deg, 45.5);
  EXPECT_EQ(file.cameras[1].eye, glm::dvec3(-1000, 0, 0));
  EXPECT_EQ(file.cameras[1].up, glm::dvec3(0, 0, 1));
}

TEST_F(CameraFileTest, GridAndImageSizeAreOptional) {
  const CameraFile file = read_camera_file(
      write(R"({"fovy_deg":60,"cameras":[{"eye":[0,0,9],"at":[0,0,0],"up":[0,1,0]}]})"));
  EXPECT_FALSE(file.dims || file.spacing || file.width || file.height);
  EXPECT_EQ(file.cameras.size(), 1u);
}

TEST_F(CameraFileTest, RefusesWhatIsNotACameraFile) {
  EXPECT_THROW(read_camera_file(folder_ / "absent.json"), Error);
  EXPECT_THROW(read_camera_file(folder_.path()), Error);
  EXPECT_THAT(refusal(""), HasSubstr("not a camera file"));
  EXPECT_THAT(refusal("{\n\"fovy_deg\":60,\n"), HasSubstr("not a camera file"));
  EXPECT_THAT(refusal("[1,2]"), HasSubstr("fovy_deg"));
  EXPECT_THAT(refusal(R"({"fovy_deg":1e999,"cameras":[]})"), HasSubstr("not a camera file"));
  // Lists within lists, parsed, would take 80 times as much memory.
  EXPECT_THAT(refusal(std::string(5u << 20, '[')), HasSubstr("it has more than 4194304 bytes"));
}

TEST_F(CameraFileTest, RefusesWhatIsGivenTwice) {
  const std::string camera = R"({"eye":[1,2,3],"at":[4,5,6],"up":[0,1,0]})";
  EXPECT_THAT(refusal(R"({"fovy_deg":50,"width":8,"width":9,"cameras":[)" + camera + "]}"),
              HasSubstr("\"width\" is given twice"));
  EXPECT_THAT(refusal(R"({"fovy_deg":50,"cameras":[{"eye":[0,0,0],)" + camera.substr(1) + "]}"),
              HasSubstr("\"eye\" is given twice"));
  EXPECT_THAT(
      refusal(R"({"fovy_deg":50,"cameras":[)" + camera + "]}" + std::string(1, '\0') + "[]"),
      HasSubstr("no JSON from byte"));
}

TEST_F(CameraFileTest, NamesTheFieldThatIsMissingOrWrong) {
  const std::string one = R"([{"eye":[0,0,9],"at":[0,0,0],"up":[0,1,0]}])";
  EXPECT_THAT(refusal(R"({"cameras":)" + one + "}"), HasSubstr("\"fovy_deg\" is missing"));
  EXPECT_THAT(refusal(R"({"fovy_deg":"60","cameras":)" + one + "}"),
              HasSubstr("\"fovy_deg\" must be a number"));
  EXPECT_THAT(refusal(R"({"fovy_deg":60})"), HasSubstr("\"cameras\" is missing"));
  EXPECT_THAT(refusal(R"({"fovy_deg":60,"cameras":[]})"), HasSubstr("at least one camera"));
  EXPECT_THAT(refusal(R"({"fovy_deg":60,"cameras":[7]})"), HasSubstr("camera 0"));
  EXPECT_THAT(refusal(R"({"fovy_deg":60,"cameras":[{"eye":[0,0,9],"at":[0,0,0]}]})"),
              HasSubstr("camera 0: \"up\" is missing"));
  EXPECT_THAT(refusal(R"({"fovy_deg":60,"cameras":[{"eye":[0,9],"at":[0,0,0],"up":[0,1,0]}]})"),
              HasSubstr("\"eye\" must be [x, y, z]"));
  EXPECT_THAT(
      refusal(R"({"fovy_deg":60,"cameras":[{"eye":[0,0,null],"at":[0,0,0],"up":[0,1,0]}]})"),
      HasSubstr("\"eye\" must be a number"));
  for (const char *width : {"0", "-4", "1.5", "4294967296", "\"640\""}) {
    EXPECT_THAT(refusal(fmt::format(R"({{"fovy_deg":60,"width":{},"cameras":{}}})", width, one)),
                HasSubstr("\"width\""));
  }
  EXPECT_THAT(refusal(R"({"fovy_deg":60,"dims":[4,0,4],"cameras":)" + one + "}"),
              HasSubstr("\"dims\""));
  EXPECT_THAT(refusal(R"({"fovy_deg":60,"spacing":[1,-1,1],"cameras":)" + one + "}"),
              HasSubstr("\"spacing\""));
}

TEST_F(CameraFileTest, RefusesDegenerateCameras) {
  EXPECT_THAT(refusal(R"({"fovy_deg":60,"cameras":[{"eye":[0,0,9],"at":[0,0,0],"up":[0,1,0]},
                                                   {"eye":[1,1,1],"at":[1,1,1],"up":[0,1,0]}]})"),
              HasSubstr("camera 1: eye and at are the same point"));
}

TEST(Camera, DegenerateOnesAreRefused) {
  const auto refused = [](const Camera &camera) {
    EXPECT_THROW(check_camera(camera, "view"), Error);
  };
  constexpr double kInf = std::numeric_limits<double>::infinity();
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_NO_THROW(check_camera({{0, 0, 9}, {0, 0, 0}, {0, 1, 0}, 60}, "view"));
  EXPECT_NO_THROW(check_camera({{0, 0, 9}, {0, 0, 0}, {0, 1, 8}, 179.9}, "view"));
  refused({{0, 0, 9}, {0, 0, 9}, {0, 1, 0}, 60});
  refused({{0, 0, 9}, {0, 0, 0}, {0, 0, 0}, 60});
  refused({{0, 0, 9}, {0, 0, 0}, {0, 0, -5}, 60});
  refused({{0, 0, 9}, {0, 0, 0}, {1e-9, 0, 5}, 60});
  refused({{0, 0, 9}, {0, 0, 0}, {0, 1, 0}, 0});
  refused({{0, 0, 9}, {0, 0, 0}, {0, 1, 0}, 180});
  refused({{0, 0, 9}, {0, 0, 0}, {0, 1, 0}, kNan});
  refused({{0, 0, kInf}, {0, 0, 0}, {0, 1, 0}, 60});
  refused({{0, 0, 9}, {0, kNan, 0}, {0, 1, 0}, 60});
  refused({{0, 0, 1e300}, {0, 0, -1e300}, {0, 1, 0}, 60});
}

TEST(OrbitCameras, StandOnACircleAboutTheBox) {
  VolumeInfo info;
  info.dims = {11, 21, 31};
  info.spacing = {2.0, 1.0, 0.5};
  info.origin = {-3.0, 4.0, 100.0};
  const glm::dvec3 centre(-3.0 + 10.0, 4.0 + 10.0, 100.0 + 7.5);
  const double distance = 0.8 * std::sqrt(20.0 * 20.0 + 20.0 * 20.0 + 15.0 * 15.0);
  const std::vector<Camera> cameras = orbit_cameras(info, 4);
  ASSERT_EQ(cameras.size(), 4u);
  for (std::size_t k = 0; k < cameras.size(); ++k) {
    const glm::dvec3 offset = cameras[k].eye - centre;
    EXPECT_NEAR(glm::length(offset), distance, 1e-12 * distance);
    EXPECT_NEAR(std::asin(offset.y / distance), 20.0 * 3.14159265358979 / 180.0, 1e-12);
    const double turn = std::atan2(offset.x, offset.z) - 0.3;
    EXPECT_NEAR(std::remainder(turn - 1.57079632679490 * double(k), 6.28318530717959), 0.0, 1e-12);
    EXPECT_EQ(cameras[k].up, glm::dvec3(0, 1, 0));
    EXPECT_EQ(cameras[k].fovy_deg, 60.0);
    EXPECT_NEAR(glm::distance(cameras[k].at, centre), 0.0, 1e-12);
    EXPECT_NO_THROW(check_camera(cameras[k], "orbit"));
  }
  EXPECT_TRUE(orbit_cameras(info, 0).empty());
}

/// Where a point is in a picture of that aspect: within [-1, 1] if it is in the picture.
glm::dvec2 place_of(const Camera &camera, const glm::dvec3 &point, double aspect) {
  const CameraAxes axes = axes_of(camera);
  const glm::dvec3 to = point - camera.eye;
  const double tan_v = std::tan(glm::radians(camera.fovy_deg) / 2);
  const double depth = glm::dot(to, axes.forward);
  return {glm::dot(to, axes.right) / (depth * tan_v * aspect),
          glm::dot(to, axes.up) / (depth * tan_v)};
}

TEST(Turntable, TurnsOnceAroundWhatTheFirstCameraLooksAt) {
  const Camera first{{3, 5, 10}, {1, 2, 3}, {0, 1, 0}, 40};
  const std::vector<Camera> cameras = turntable(first, 8);
  ASSERT_EQ(cameras.size(), 8u);
  EXPECT_EQ(cameras.front(), first);
  for (std::size_t k = 0; k < cameras.size(); ++k) {
    EXPECT_EQ(cameras[k].at, first.at);
    EXPECT_EQ(cameras[k].up, first.up);
    EXPECT_EQ(cameras[k].fovy_deg, 40);
    const glm::dvec3 offset = cameras[k].eye - first.at, was = first.eye - first.at;
    EXPECT_NEAR(offset.y, was.y, 1e-12);
    // Anticlockwise from above, as --orbit: x grows with the sine.
    const double turn = std::atan2(offset.x, offset.z) - std::atan2(was.x, was.z);
    EXPECT_NEAR(std::remainder(turn - 0.785398163397448 * double(k), 6.28318530717959), 0, 1e-12);
  }
  EXPECT_EQ(turntable(first, 1), std::vector{first});
}

TEST(Turntable, TurnsAboutAnUpAxisThatIsNotTheWorlds) {
  const Camera first{{5, 0, 0}, {0, 0, 0}, {0, 0, 2}, 40};
  EXPECT_NEAR(glm::distance(turntable(first, 4).at(1).eye, glm::dvec3(0, 5, 0)), 0, 1e-12);
}

TEST(Turntable, KeepsALongBoxInAllPictures) {
  VolumeInfo info;
  info.dims = {101, 11, 11};
  info.spacing = {1.0, 2.0, 0.5};
  const glm::dvec3 begin(4, 0, 2), end(96, 8, 10);
  constexpr double kAspect = 1.5;
  double closest = 0;
  for (const std::uint32_t n : {1u, 4u, 7u}) {
    closest = 0;
    for (const Camera &camera :
         turntable(camera_of_box(info, begin, end, kAspect, {.num_views = n}), n)) {
      for (int corner = 0; corner < 8; ++corner) {
        const glm::dvec3 index(corner & 1 ? begin.x : end.x, corner & 2 ? begin.y : end.y,
                               corner & 4 ? begin.z : end.z);
        const glm::dvec2 place = glm::abs(place_of(camera, index * info.spacing, kAspect));
        EXPECT_LT(std::max(place.x, place.y), 0.95 + 1e-9) << n;
        closest = std::max({closest, place.x, place.y});
      }
    }
    EXPECT_NEAR(closest, 0.95, 1e-9) << n << " views from no further than that needs";
  }
}

TEST(OrbitCameras, ArePulledBackForPicturesThatAreNarrowerThanHigh) {
  VolumeInfo info;
  info.dims = {11, 21, 31};
  const auto distance = [&](double aspect) {
    const Camera camera = orbit_cameras(info, 1, {}, aspect).at(0);
    return glm::distance(camera.eye, camera.at);
  };
  EXPECT_EQ(distance(2), distance(1));
  EXPECT_NEAR(distance(0.5), 2 * distance(1), 1e-12 * distance(1));
}

TEST(OrbitCameras, FollowADirectionMatrix) {
  VolumeInfo info;
  info.dims = {11, 11, 11};
  info.direction = glm::dmat3({-1, 0, 0}, {0, 0, 1}, {0, 1, 0});
  const std::vector<Camera> cameras = orbit_cameras(info, 1);
  EXPECT_NEAR(glm::distance(cameras.at(0).at, glm::dvec3(-5, 5, 5)), 0.0, 1e-12);
}

}  // namespace
}  // namespace isowave::core
