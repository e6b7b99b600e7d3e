// The rays of photoncard's example `rays`, cast by Embree 3 one at a time or in packets of 16 on one thread.
//
// rays FOLDER REPEAT fast|watertight 1|16: reads triangles and rays as the example leaves them, and prints what it prints.
#include <embree3/rtcore.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <fstream>
#include <iterator>
#include <string>
#include <vector>

static std::vector<float> read(const std::string &path) {
    std::ifstream file(path, std::ios::binary);
    std::vector<char> bytes((std::istreambuf_iterator<char>(file)), std::istreambuf_iterator<char>());
    std::vector<float> numbers(bytes.size() / sizeof(float));
    std::memcpy(numbers.data(), bytes.data(), numbers.size() * sizeof(float));
    return numbers;
}

// What rays meet.
struct Met {
    size_t hits = 0;
    double sum = 0;
};

static Met cast_alone(RTCScene scene, RTCIntersectContext *context, const std::vector<float> &rays, bool is_any) {
    Met met;
    for (size_t i = 0; i < rays.size() / 6; ++i) {
        const float *ray = &rays[6 * i];
        RTCRayHit query{};
        query.ray.org_x = ray[0], query.ray.org_y = ray[1], query.ray.org_z = ray[2];
        query.ray.dir_x = ray[3], query.ray.dir_y = ray[4], query.ray.dir_z = ray[5];
        query.ray.tnear = 0;
        query.ray.tfar = INFINITY;
        query.ray.mask = ~0u;
        query.hit.geomID = RTC_INVALID_GEOMETRY_ID;
        if (is_any) {
            rtcOccluded1(scene, context, &query.ray);
            met.hits += query.ray.tfar < 0;
        } else {
            rtcIntersect1(scene, context, &query);
            if (query.hit.geomID != RTC_INVALID_GEOMETRY_ID) {
                met.hits += 1;
                met.sum += query.ray.tfar;
            }
        }
    }
    return met;
}

static Met cast_packets(RTCScene scene, RTCIntersectContext *context, const std::vector<float> &rays, bool is_any) {
    Met met;
    for (size_t first = 0; first < rays.size() / 6; first += 16) {
        const size_t number = std::min<size_t>(16, rays.size() / 6 - first);
        int valid[16];
        RTCRayHit16 query{};
        for (size_t lane = 0; lane < 16; ++lane) {
            valid[lane] = lane < number ? -1 : 0;
            const float *ray = &rays[6 * (first + std::min(lane, number - 1))];
            query.ray.org_x[lane] = ray[0], query.ray.org_y[lane] = ray[1], query.ray.org_z[lane] = ray[2];
            query.ray.dir_x[lane] = ray[3], query.ray.dir_y[lane] = ray[4], query.ray.dir_z[lane] = ray[5];
            query.ray.tfar[lane] = INFINITY;
            query.ray.mask[lane] = ~0u;
            query.hit.geomID[lane] = RTC_INVALID_GEOMETRY_ID;
        }
        if (is_any) {
            rtcOccluded16(valid, scene, context, &query.ray);
        } else {
            rtcIntersect16(valid, scene, context, &query);
        }
        for (size_t lane = 0; lane < number; ++lane) {
            if (is_any) {
                met.hits += query.ray.tfar[lane] < 0;
            } else if (query.hit.geomID[lane] != RTC_INVALID_GEOMETRY_ID) {
                met.hits += 1;
                met.sum += query.ray.tfar[lane];
            }
        }
    }
    return met;
}

int main(int count, char **arguments) {
    if (count != 5) {
        std::fprintf(stderr, "usage: rays FOLDER REPEAT fast|watertight 1|16\n");
        return 1;
    }
    const std::string folder = arguments[1];
    const int repeat = std::max(1, std::atoi(arguments[2]));
    const std::vector<float> corners = read(folder + "/triangles");
    const std::vector<float> rays = read(folder + "/rays");
    if (corners.empty() || rays.empty()) {
        std::fprintf(stderr, "%s holds no triangles or no rays\n", folder.c_str());
        return 1;
    }

    RTCDevice device = rtcNewDevice("threads=1");
    RTCScene scene = rtcNewScene(device);
    RTCGeometry mesh = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
    float *vertices = static_cast<float *>(rtcSetNewGeometryBuffer(
        mesh, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, 3 * sizeof(float), corners.size() / 3));
    std::copy(corners.begin(), corners.end(), vertices);
    unsigned *indices = static_cast<unsigned *>(rtcSetNewGeometryBuffer(
        mesh, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, 3 * sizeof(unsigned), corners.size() / 9));
    for (size_t i = 0; i < corners.size() / 3; ++i) {
        indices[i] = static_cast<unsigned>(i);
    }
    rtcSetGeometryBuildQuality(mesh, RTC_BUILD_QUALITY_HIGH);
    rtcCommitGeometry(mesh);
    rtcAttachGeometry(scene, mesh);
    rtcReleaseGeometry(mesh);
    rtcSetSceneBuildQuality(scene, RTC_BUILD_QUALITY_HIGH);
    const std::string mode = arguments[3];
    rtcSetSceneFlags(scene, mode == "fast" ? RTC_SCENE_FLAG_NONE : RTC_SCENE_FLAG_ROBUST);
    rtcCommitScene(scene);

    const bool is_packet = std::string(arguments[4]) == "16";
    RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    // Packets are of rays of a place and a cell.
    context.flags = is_packet ? RTC_INTERSECT_CONTEXT_FLAG_COHERENT : RTC_INTERSECT_CONTEXT_FLAG_INCOHERENT;
    const size_t number = rays.size() / 6;
    for (const bool is_any : {false, true}) {
        std::vector<double> seconds;
        Met met;
        for (int round = 0; round < repeat; ++round) {
            const std::clock_t start = std::clock();
            met = is_packet ? cast_packets(scene, &context, rays, is_any) : cast_alone(scene, &context, rays, is_any);
            seconds.push_back(static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC);
        }
        std::sort(seconds.begin(), seconds.end());
        std::printf("embree-%s%s %s: %.0f rays a second; %zu of %zu meet a triangle, sum %.3f\n", mode.c_str(),
                    is_packet ? "-packets" : "", is_any ? "any" : "closest", number / seconds[seconds.size() / 2], met.hits,
                    number, met.sum);
    }
    rtcReleaseScene(scene);
    rtcReleaseDevice(device);
    return 0;
}
